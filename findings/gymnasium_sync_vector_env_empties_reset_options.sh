#!/usr/bin/env bash
# Gymnasium 1.4.0: SyncVectorEnv.reset(options={"reset_mask": mask}) takes the mask out of the caller's own dictionary. A
# loop that keeps one options dictionary resets the chosen environments once, and all of them from the second time on.
# Guess before running: options are read only.
# Seen: "after the first reset the dictionary holds []; the second reset restarts [True, True]". Exits 1 if that changes.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" && "$folder/venv/bin/python" -m pip install --quiet "gymnasium==1.4.0" 2>/dev/null
cat > "$folder/show.py" <<'P'
import sys
import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
env = SyncVectorEnv([lambda: gym.make("CartPole-v1")] * 2, autoreset_mode=AutoresetMode.DISABLED)
env.reset(seed=0)
options = {"reset_mask": np.array([True, False])}
before, _ = env.reset(options=options)
held = list(options)
before = before.copy()
after, _ = env.reset(options=options)
restarted = [bool((a != b).any()) for a, b in zip(after, before)]
print(f"gymnasium {gym.__version__}: after the first reset the dictionary holds {held}; the second restarts {restarted}")
sys.exit(0 if held == [] and restarted == [True, True] else 1)
P
"$folder/venv/bin/python" "$folder/show.py"
