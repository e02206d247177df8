"""Put the results of a comparison where readers see them: docs/benchmark/NAME/ and the table NAME in README.md.

Of one under several scenarios README shows the map, which is a picture; every episode goes into episodes/SCENARIO.csv.
"""

import argparse
import shutil
from pathlib import Path

from caster_gym.report.pages import between_marks

ROOT = Path(__file__).resolve().parent.parent
ALWAYS = ("table.md", "run.yaml")
OF_ONE = ("summary.csv", "overview.png")  # of a comparison on one task; and all other figures
OF_SCENARIOS = ("scenarios.csv", "tuning.csv", "regimes.png")  # of one under several scenarios


def publish(run: Path, name: str) -> None:
    """Copy tables and figures of a finished comparison, and set its table between README's marks."""
    scenarios = sorted(file.parent for file in run.glob("*/episodes.csv"))
    files = (*ALWAYS, *(OF_SCENARIOS if scenarios else OF_ONE))
    missing = [file for file in files if not (run / file).is_file()]
    if missing:
        raise SystemExit(f"{run} lacks {', '.join(missing)}; run `make benchmark` first")
    target = ROOT / "docs" / "benchmark" / name
    target.mkdir(parents=True, exist_ok=True)
    for file in {run / name for name in files} | set(run.glob("*.png")):
        shutil.copyfile(file, target / file.name)
    for scenario in scenarios:
        (target / "episodes").mkdir(exist_ok=True)
        shutil.copyfile(scenario / "episodes.csv", target / "episodes" / f"{scenario.name}.csv")
    if scenarios:
        return
    readme = ROOT / "README.md"
    begin, end = f"<!-- table {name}: begin -->\n", f"<!-- table {name}: end -->"
    table = (run / "table.md").read_text(encoding="utf-8")
    readme.write_text(between_marks(readme.read_text(encoding="utf-8"), begin, end, table), encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, nargs="?", default=ROOT / "runs" / "benchmark", help="folder of a comparison")
    parser.add_argument("name", nargs="?", default="track", help="name of the comparison, as in configs/benchmarks")
    arguments = parser.parse_args()
    publish(arguments.run, arguments.name)
