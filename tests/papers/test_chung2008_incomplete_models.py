"""The section on computed torque with incomplete models tells what the trials measured."""

import pytest
from numpy.testing import assert_allclose

from caster_gym.paths.headings import Spinning
from caster_gym.paths.random_paths import RandomPaths
from caster_gym.paths.shapes import Ellipse
from papers.chung2008 import incomplete_models, model_trials
from papers.chung2008.model_trials import BARE, EXACT, FREQUENCIES, PATHS, SOFT
from papers.page import unexplained


@pytest.fixture(scope="module")
def page():
    """The section with fewer, shorter and faster motions; its studies."""
    kept = []
    build = model_trials.study
    with pytest.MonkeyPatch.context() as patch:
        for name in model_trials.LONGEST:
            patch.setitem(model_trials.LONGEST, name, 12.0)
        patch.setitem(PATHS, "ellipse", Ellipse(semi_axes=(1.0, 0.6), heading=Spinning()))
        patch.setitem(PATHS, "random paths", RandomPaths(count=1, seed=2))
        patch.setattr(model_trials, "STARTS", 1)
        for module in (model_trials, incomplete_models):
            patch.setattr(module, "RUNGS", 2)

        def kept_study(name):
            kept.append(build(name))
            return kept[-1]

        patch.setattr(incomplete_models, "study", kept_study)
        return incomplete_models.section(), kept


def test_every_check_agrees_or_names_an_erratum(page):
    section, _ = page
    assert [check.agrees for check in section.checks] == [True, True, True, False, True]
    assert [check.own for check in section.checks] == ["xr4000" in check.what for check in section.checks]
    assert unexplained([section]) == ()
    assert {difference.tag for difference in section.differences} == {"E3"}


def test_checks_tables_and_text_tell_what_was_measured(page):
    section, (own, other) = page
    assert (own.robot, other.robot) == ("chung2008", "xr4000")
    worse = own.position[BARE] / own.position[EXACT]
    assert f"position RMSE {worse.min():.1f} … {worse.max():.1f} times" in section.checks[0].ours
    tables = {table.name: table for table in section.tables}
    cases = 2 * len(PATHS) * len(FREQUENCIES)
    assert [len(table.rows) for table in section.tables] == [2 * cases, 2 * cases, 3 * cases, 8, cases]
    assert all(len(row) == len(table.columns) for table in section.tables for row in table.rows)
    assert_allclose(tables["incomplete_models"].rows[0][4:7], 1e3 * own.position[:, SOFT, 0, 0], rtol=1e-12)
    assert tables["incomplete_models"].rows[0][8] == pytest.approx(worse[SOFT, 0, 0])
    row = dict(zip(tables["incomplete_models_all"].columns, tables["incomplete_models_all"].rows[1], strict=True))
    assert row["predicted [mm], without wheels"] == pytest.approx(1e3 * own.predicted[BARE, SOFT, 0, 1])
    assert row["heading RMSE [mrad], exact"] == pytest.approx(1e3 * own.heading[EXACT, SOFT, 0, 1])
    assert f"at least {min((s.position[2] / s.position[0]).min() for s in (own, other)):.1f} times" in " ".join(
        section.text.split()
    )


def test_the_order_of_the_models_is_the_same_from_disturbed_starts(page):
    for study in page[1]:
        exact, printed, bare = study.disturbed
        assert (exact < printed).all()
        assert (2.0 * printed < bare).all()


def test_the_picture_has_a_panel_for_every_robot_and_path(page, tmp_path):
    (picture,) = page[0].pictures
    assert len(picture.figure.axes) == 2 * len(PATHS)
    picture.figure.savefig(tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 10_000
