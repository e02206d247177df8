"""Pages in Markdown, put together from their parts."""

import textwrap
from collections.abc import Iterable


def join_parts(parts: Iterable[str]) -> str:
    """A page from its headings, paragraphs, tables and pictures, with a blank line between them; drops empty parts."""
    return "\n\n".join(part for part in parts if part) + "\n"


def paragraph(text: str) -> str:
    """The text in lines of 120 characters, however it was broken."""
    return textwrap.fill(" ".join(text.split()), 120, break_long_words=False, break_on_hyphens=False)


def between_marks(page: str, begin: str, end: str, text: str) -> str:
    """The page with a text in place of what stands between two marks. Raises ValueError unless each is there once."""
    if page.count(begin) != 1 or page.count(end) != 1 or page.index(begin) > page.index(end):
        raise ValueError(f"the page must hold {begin.strip()} once, and {end.strip()} once after it")
    before, rest = page.split(begin)
    return before + begin + text + end + rest.split(end)[1]
