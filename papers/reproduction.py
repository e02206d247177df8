"""Both papers, reproduced: every section of their pages, built one after the other and put down at once."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from caster_gym.configuration import did_you_mean
from caster_gym.durable_files import MARK, write_file
from caster_gym.report.provenance import write_provenance
from caster_gym.report.run_folder import check_free, staged
from papers.page import Section, differences_page, printed_checks, unexplained, write_page

FILES = ("*.csv", "*.png", "run.yaml")


class Paper(NamedTuple):
    """A paper and where the sections of its page are built."""

    title: str
    reference: str
    parts: dict[str, str]  # what is being computed -> module:function


PAPERS = {
    "chung2008": Paper(
        "Singularity-free dynamics of a robot on three casters: chung2008",
        "J. H. Chung, B.-J. Yi, W. K. Kim and S.-Y. Han, *Singularity-Free Dynamic Modeling Including Wheel Dynamics "
        "for an Omni-Directional Mobile Robot with Three Caster Wheels*, International Journal of Control, Automation, "
        "and Systems 6(1), 2008.",
        {
            "kinematics": "papers.chung2008.kinematics:section",
            "accelerations": "papers.chung2008.hessians:section",
            "orthogonal complement": "papers.chung2008.complement:section",
            "operational forces": "papers.chung2008.forces:section",
            "wheel mass": "papers.chung2008.wheel_mass:section",
            "missing term": "papers.chung2008.missing_term:section",
            "incomplete models": "papers.chung2008.incomplete_models:section",
            "impulse": "papers.chung2008.impulse:section",
            "uniform impulse": "papers.chung2008.circles:section",
        },
    ),
    "kim2001": Paper(
        "Singularities and isotropy of a robot on three casters: kim2001",
        "W. Kim, D. H. Kim, B.-J. Yi, B.-J. You and S.-I. Yang, *Design of an Omni-directional Mobile Robot with 3 "
        "Caster Wheels*, Transactions on Control, Automation and Systems Engineering 3, 2001.",
        {
            "kinematics": "papers.kim2001.kinematics:section",
            "singularities": "papers.kim2001.singularity:section",
            "lines of joints": "papers.kim2001.lines:section",
            "sets of joints": "papers.kim2001.joint_sets:section",
            "trails": "papers.kim2001.trails:section",
            "isotropy of three joints": "papers.kim2001.isotropy:three_joints",
            "isotropy of four joints": "papers.kim2001.redundancy:four_joints",
            "isotropy of six joints": "papers.kim2001.redundancy:six_joints",
        },
    ),
}


class Verdict(NamedTuple):
    """How many printed numbers and statements agree, and the names of those that differ without a reason."""

    agreeing: int
    compared: int
    unexplained: tuple[str, ...]


def find_paper(name: str) -> Paper:
    """The paper of a name; raises ValueError that names those that there are."""
    if name not in PAPERS:
        raise ValueError(f"unknown paper {name!r}; {did_you_mean(name, PAPERS)}")
    return PAPERS[name]


def reproduce(name: str, out: Path, overwrite: bool, report: Callable[[str, int], None]) -> Verdict:
    """Compute everything of a paper, then put OUT/NAME.md and the folder OUT/NAME in their places.

    report is told what comes next and how many parts are done. What was there before stays until all is computed.
    """
    paper = find_paper(name)
    _check_out(name, out, overwrite)
    sections = []
    for done, (work, place) in enumerate(paper.parts.items()):
        report(work, done)
        sections.append(_build(place))
    report("done", len(sections))
    with staged(out / name, overwrite, FILES) as fresh:
        page = write_page(name, paper.title, paper.reference, sections, fresh)
        write_provenance(fresh, paper=name)
    write_file(out / f"{name}.md", page)
    write_file(out / "differences.md", differences_page(out, tuple(PAPERS)))
    printed = printed_checks(sections)
    return Verdict(sum(check.agrees for check in printed), len(printed), unexplained(sections))


def _check_out(name: str, out: Path, overwrite: bool) -> None:
    """Refuse a folder that cannot be had, and one with pages of the same names that are not ours."""
    check_free(out / name, overwrite, FILES)
    page, differences = out / f"{name}.md", out / "differences.md"
    if page.exists() and not (out / name / MARK).is_file():
        raise ValueError(f"{page} is there already, and not from caster-gym; choose another --out")
    if differences.exists() and not any((out / paper / MARK).is_file() for paper in PAPERS):
        raise ValueError(f"{differences} is there already, and not from caster-gym; choose another --out")


def _build(place: str) -> Section:
    module, function = place.split(":")
    section: Section = getattr(import_module(module), function)()
    return section
