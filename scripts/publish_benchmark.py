"""Put the results of a comparison where readers see them: docs/benchmark/NAME/ and the table NAME in README.md."""

import argparse
import re
import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FILES = ("table.md", "summary.csv", "run.yaml", "overview.png")  # and all other figures


def publish(run: Path, name: str) -> None:
    """Copy tables and figures of a finished comparison, and set its table between README's marks."""
    missing = [file for file in FILES if not (run / file).is_file()]
    if missing:
        raise SystemExit(f"{run} lacks {', '.join(missing)}; run `make benchmark` first")
    target = ROOT / "docs" / "benchmark" / name
    target.mkdir(parents=True, exist_ok=True)
    for file in {run / name for name in FILES} | set(run.glob("*.png")):
        shutil.copyfile(file, target / file.name)
    readme = ROOT / "README.md"
    begin, end = f"<!-- table {name}: begin -->\n", f"<!-- table {name}: end -->"
    between = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    table = (run / "table.md").read_text(encoding="utf-8")
    changed, count = between.subn(lambda _: begin + table + end, readme.read_text(encoding="utf-8"))
    if count != 1:
        raise SystemExit(f"README.md must hold {begin.strip()} and {end} once")
    readme.write_text(changed, encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, nargs="?", default=ROOT / "runs" / "benchmark", help="folder of a comparison")
    parser.add_argument("name", nargs="?", default="track", help="name of the comparison, as in configs/benchmarks")
    arguments = parser.parse_args()
    publish(arguments.run, arguments.name)
