"""The page of a long run."""

from collections.abc import Iterable, Sequence
from statistics import median
from typing import Any

from caster_gym.report.pages import join_parts, paragraph
from caster_gym.report.provenance import versions_in_words
from caster_gym.report.tables import markdown_table
from scripts.soak_scenes import KINDS

HEAD = """# A long run

Batches of robots drive with random torques at their limits, or random commands of inner loops, in closed rooms with
half-planes, walls, pillars and polygons, some of which overlap or leave gaps as wide as a robot. Features, pushes,
restarts, floors and modes of autoreset are drawn for each leg from the seed and its number. After every step it is
checked of every robot:

- **Finite**: observations, rewards and all numbers in infos.
- **Inside**: its centre is within the room; gaps to the room's walls, worked out anew from pose and footprint, and to
  all obstacles, as the environment tells them, are no less than −100 µm, five times what one segment of a time step may
  add (20 µm, `SLOP` in `mechanics/first_contact.py`).
- **Energy**: floor, friction and impacts only take it, so that its rise in a control period T is no more than the work
  of motors and push, K₁ − K₀ ≤ A + W. A is told by the trapezoidal rule for each time step h: where a motor's speed
  changes steadily by Δ while its torque τ is held, that misses ½ τ |Δ| h at most. W is told by the same rule over T,
  which misses ½ |F| |Δv| T. Impulses J of contacts with friction μ are found to 1 nm/s, so that they
  may add (1 + μ) J · 1 nm/s: all the energy that a robot has which is held against a wall. These three are the only
  slack, beside rounding, but for robots that lie against something: they bounce within a time step, at less than
  10 mm/s, of which the speeds at its ends tell little, so that their motors' work counts as any up to what it would be
  at those speeds. What is unexplained is told as a share of the energy.
- **Memory** of the process is sampled after every leg. In the first round of kinds code is compiled or loaded; after
  it, memory must not grow by more than 5 % from the first to the last third of the legs."""
GROWTH = 0.05  # what is freed is not always given back to the system


def page(rows: Sequence[Any]) -> str:
    """The figures of all legs (rows of `scripts.soak`) in words and in a table of kinds."""
    kinds = list(dict.fromkeys((row.robot, row.task) for row in rows))
    columns = ("robot", "task", "robot steps", "episodes ended", "impacts", "least gap [µm]", "unexplained energy [-]")
    lines = [_line(kind, [row for row in rows if (row.robot, row.task) == kind]) for kind in kinds]
    lines.append(_line(("all", ""), rows))
    faults = faults_of(rows)
    found = "Nothing was found." if not faults else "\n".join(["Found:", "", *(f"- {one}" for one in faults)])
    how = (
        f"{sum(row.steps for row in rows):,} robot steps in {len(rows)} legs of seed {rows[0].seed}, "
        f"{sum(row.seconds for row in rows) / 3600.0:.2g} h. {_memory(rows)} "
        f"{versions_in_words('numpy', 'numba', 'gymnasium')}. The table legs.csv has a row for each leg."
    )
    table = markdown_table(columns, lines)
    return join_parts([HEAD, found, paragraph(how), table, "Made by `python -m scripts.soak`; `--resume` goes on."])


def _line(kind: tuple[str, str], rows: Sequence[Any]) -> tuple[str, ...]:
    numbers: Iterable[int] = (sum(getattr(row, name) for row in rows) for name in ("steps", "episodes", "impacts"))
    excess = max(0.0, *(row.excess for row in rows)) if rows else 0.0
    least = 1e6 * min(row.least_gap for row in rows)
    return (*kind, *(f"{number:,}" for number in numbers), f"{least:.3g}", f"{excess:.2g}")


def faults_of(rows: Sequence[Any]) -> list[str]:
    """All that was found, in words."""
    faults = [f"leg {row.leg} ({row.robot}, {row.task}): {row.faults}" for row in rows if row.faults]
    first, last = _memory_at_ends(rows)
    if last > (1.0 + GROWTH) * first:
        faults.append(f"memory grew from {first:.0f} to {last:.0f} MB")
    return faults


def _memory_at_ends(rows: Sequence[Any]) -> tuple[float, float]:
    """Medians of the memory [MB] in the first and the last third after the first round, of the process that ended it.

    Zero where there are no three legs.
    """
    later = [row.memory for row in rows if row.process == rows[-1].process][KINDS:]
    third = len(later) // 3
    return (median(later[:third]), median(later[-third:])) if third else (0.0, 0.0)


def _memory(rows: Sequence[Any]) -> str:
    """By how much memory grew after the first round."""
    first, last = _memory_at_ends(rows)
    if not first:
        return f"Resident memory was {rows[-1].memory:.0f} MB; growth is told after the first round of {KINDS} kinds."
    return (
        f"After the first round of {KINDS} kinds, resident memory was {first:.0f} MB in the first third of the legs "
        f"and {last:.0f} MB in the last (medians)."
    )
