#!/usr/bin/env bash
# MuJoCo 4.0.0: with the default pyramidal friction cone a resting ball sinks the deeper the greater its sliding friction;
# with the elliptic cone the depth does not depend on it. At friction 5 the pyramid lets it sink 146 times as deep as at
# friction 1. Attaching a model (MjSpec.attach) keeps the scene's cone, so a model made for the elliptic one sinks.
# Guess before running: friction acts along the floor and does not change how deep a body rests.
# Seen, a ball of 25 mm and 2.27 kg at friction 1 and 5: pyramidal 0.0175 and 2.5506 mm, elliptic 0.0175 and 0.0175 mm.
# Exits 1 if that changes.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" && "$folder/venv/bin/python" -m pip install --quiet "mujoco==4.0.0" 2>/dev/null
cat > "$folder/show.py" <<'P'
import sys
import mujoco
def depth(cone, friction):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="0.002" cone="{cone}"/>
<default><geom condim="3" friction="{friction} 0 0" solref="0.004 1"/></default><worldbody><geom type="plane" size="1 1 1"/>
<body pos="0 0 0.025"><freejoint/><geom type="sphere" size="0.025" mass="2.27"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 1000)
    return 1e3 * (0.025 - float(data.qpos[2]))
seen = {(cone, friction): depth(cone, friction) for cone in ("pyramidal", "elliptic") for friction in (1, 5)}
print({key: f"{value:.4f} mm" for key, value in seen.items()})
same = abs(seen["elliptic", 5] / seen["elliptic", 1] - 1) < 1e-6
sys.exit(0 if same and seen["pyramidal", 5] > 50 * seen["pyramidal", 1] else 1)
P
"$folder/venv/bin/python" "$folder/show.py"
