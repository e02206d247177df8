"""The page of a long run."""

from collections.abc import Iterable, Sequence
from typing import Any

from caster_gym.report.pages import join_parts, paragraph
from caster_gym.report.provenance import versions_in_words
from caster_gym.report.tables import markdown_table

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
  which misses ½ |F| |Δv| T. These two are the only slack, beside rounding. What is unexplained is told as a share of
  the energy.
- **Memory** of the process is sampled after every leg. In the first round code is compiled or loaded; after it, memory
  should stay."""


def page(rows: Sequence[Any]) -> str:
    """The figures of all legs (rows of `scripts.soak`) in words and in a table of kinds."""
    kinds = list(dict.fromkeys((row.robot, row.task) for row in rows))
    columns = ("robot", "task", "robot steps", "episodes ended", "impacts", "least gap [µm]", "unexplained energy [-]")
    lines = [_line(kind, [row for row in rows if (row.robot, row.task) == kind]) for kind in kinds]
    lines.append(_line(("all", ""), rows))
    faults = [f"leg {row.leg} ({row.robot}, {row.task}): {row.faults}" for row in rows if row.faults]
    found = "Nothing was found." if not faults else "\n".join(["Found:", "", *(f"- {one}" for one in faults)])
    how = (
        f"{sum(row.steps for row in rows):,} robot steps in {len(rows)} legs of seed {rows[0].seed}, "
        f"{sum(row.seconds for row in rows) / 3600.0:.2g} h. {_memory(rows, len(kinds))} "
        f"{versions_in_words('numpy', 'numba', 'gymnasium')}. The table legs.csv has a row for each leg."
    )
    table = markdown_table(columns, lines)
    return join_parts([HEAD, found, paragraph(how), table, "Made by `python -m scripts.soak`; `--resume` goes on."])


def _line(kind: tuple[str, str], rows: Sequence[Any]) -> tuple[str, ...]:
    numbers: Iterable[int] = (sum(getattr(row, name) for row in rows) for name in ("steps", "episodes", "impacts"))
    excess = max(0.0, *(row.excess for row in rows)) if rows else 0.0
    least = 1e6 * min(row.least_gap for row in rows)
    return (*kind, *(f"{number:,}" for number in numbers), f"{least:.3g}", f"{excess:.2g}")


def _memory(rows: Sequence[Any], kinds: int) -> str:
    """By how much memory grew after the first round, in the process that made the most legs."""
    last = [row.memory for row in rows if row.process == rows[-1].process]
    if len(last) <= kinds:
        return f"Resident memory was {last[-1]:.0f} MB; growth is told after the first round of {kinds} kinds of legs."
    after = last[kinds - 1 :]
    return (
        f"Resident memory was {after[0]:.0f} MB after the first round of kinds and {max(after):.0f} MB at most later."
    )
