"""Put the results of `make benchmark` where readers see them: docs/benchmark/ and the table in README.md."""

import argparse
import re
import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TABLE = re.compile(r"(<!-- table: begin -->\n).*?(<!-- table: end -->)", re.DOTALL)
FILES = ("table.md", "summary.csv", "run.yaml", "overview.png", "paths.png", "errors.png", "torques.png")


def publish(run: Path) -> None:
    """Copy tables and figures of a finished comparison, and set the table between README's marks."""
    missing = [name for name in FILES if not (run / name).is_file()]
    if missing:
        raise SystemExit(f"{run} lacks {', '.join(missing)}; run `make benchmark` first")
    target = ROOT / "docs" / "benchmark"
    target.mkdir(parents=True, exist_ok=True)
    for name in (*FILES, "learning.png"):
        if (run / name).is_file():
            shutil.copyfile(run / name, target / name)
    readme = ROOT / "README.md"
    text, table = readme.read_text(encoding="utf-8"), (run / "table.md").read_text(encoding="utf-8")
    changed, count = TABLE.subn(lambda match: match[1] + table + match[2], text)
    if count != 1:
        raise SystemExit("README.md must hold the marks <!-- table: begin --> and <!-- table: end --> once")
    readme.write_text(changed, encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, nargs="?", default=ROOT / "runs" / "benchmark", help="folder of a comparison")
    publish(parser.parse_args().run)
