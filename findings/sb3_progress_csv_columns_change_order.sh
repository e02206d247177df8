#!/usr/bin/env bash
# Stable-Baselines3 2.9.2 writes the columns of progress.csv in an order that differs from process to process: what is
# new in a row is collected in a Python set of texts, whose order follows the hash seed of the process. Two trainings
# with one seed and equal weights leave files that differ, and a script that reads columns by their place is wrong
# at the next start. What reads by name is not affected.
# Guess before running: columns stand in the order in which they were first recorded, in every process.
# Seen: 4 columns, recorded in one order, in 3 orders in 3 processes. Exits 1 if that changes.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "torch==2.13.0" "stable-baselines3==2.9.2" "gymnasium==1.4.0" 2>/dev/null
cat > "$folder/record.py" <<'P'
import pathlib, sys
from stable_baselines3.common.logger import configure
logger = configure(sys.argv[1], ["csv"])
for name in ("time/iterations", "rollout/ep_rew_mean", "train/loss", "train/std"):
    logger.record(name, 1.0)
logger.dump(1)
print(pathlib.Path(sys.argv[1], "progress.csv").read_text().splitlines()[0])
P
for seed in 1 2 3; do
  PYTHONHASHSEED=$seed "$folder/venv/bin/python" "$folder/record.py" "$folder/$seed" 2>/dev/null | tail -1
done | sort -u | tee "$folder/orders"
orders=$(wc -l < "$folder/orders")
echo "one order of recording, $orders orders of columns in 3 processes"
[ "$orders" -eq 3 ]
