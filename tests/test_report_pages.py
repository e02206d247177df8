"""caster_gym.report.pages: parts, paragraphs, and what stands between marks."""

from itertools import pairwise

import pytest

from caster_gym.report.pages import between_marks, join_parts, paragraph


def test_parts_are_separated_by_one_blank_line_and_empty_ones_drop_out():
    assert join_parts(["# A", "", "text", "| a |"]) == "# A\n\ntext\n\n| a |\n"


def test_a_paragraph_is_broken_anew_between_words():
    words = [f"word-{i}" for i in range(60)]
    lines = paragraph("\n      ".join(words)).splitlines()
    assert " ".join(lines).split() == words
    assert all(len(line) <= 120 for line in lines)
    assert all(len(line) + 1 + len(after.split()[0]) > 120 for line, after in pairwise(lines))


def test_only_what_stands_between_the_marks_changes():
    page = "before <a> old <b> after <a page may hold marks of others>"
    assert between_marks(page, "<a>", "<b>", "new") == "before <a>new<b> after <a page may hold marks of others>"


@pytest.mark.parametrize("page", ["", "<a>", "<b>", "<a> <a> <b>", "<a> <b> <b>", "<b> <a>"])
def test_a_page_without_both_marks_in_order_is_refused(page):
    with pytest.raises(ValueError, match="the page must hold <a> once, and <b> once after it"):
        between_marks(page, "<a>", "<b>", "new")
