#!/usr/bin/env bash
# MuJoCo 4.0.0: a sphere that slides over a plane does not press on it steadily. Its cone of friction is convex, so that
# sliding pushes the contact apart; the sphere leaves the floor, falls back, and its weight comes in beats. On average
# the normal force is the weight, and friction is that of Coulomb; a robot on four stiff legs rocks.
# Guess before running: a normal force of 9.81 N throughout, as at rest.
# Seen: at 2 m/s, friction 0.3, elliptic cone, 1 ms: no force in 78 of 100 steps, at most 8 weights, mean 1.01. Exits 1 if not.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" && "$folder/venv/bin/python" -m pip install --quiet "mujoco==4.0.0"
cat > "$folder/show.py" <<'P'
import sys
import mujoco, numpy as np
model = mujoco.MjModel.from_xml_string('''<mujoco><option timestep="0.001" cone="elliptic"/><worldbody>
<geom type="plane" size="50 50 1" friction="0.3 0 0"/><body pos="0 0 0.05"><joint type="slide" axis="1 0 0"/>
<joint type="slide" axis="0 0 1"/><geom type="sphere" size="0.05" mass="1" friction="0.3 0 0"/></body>
</worldbody></mujoco>''')
data, force = mujoco.MjData(model), np.zeros(6)

def loads(steps):
    found = []
    for _ in range(steps):
        mujoco.mj_step(model, data)
        found.append(0.0)
        if data.ncon:
            mujoco.mj_contactForce(model, data, 0, force)
            found[-1] = force[0] / 9.81
    return np.array(found)

loads(500)
rest = loads(100)
data.qvel[0] = 2.0
slides = loads(400)
print(f"at rest {rest.min():.2f} to {rest.max():.2f} weights; sliding: {100 * (slides == 0.0).mean():.0f} of 100 steps "
      f"without a force, at most {slides.max():.0f} weights, mean {slides.mean():.2f}")
sys.exit(0 if rest.min() > 0.99 and (slides == 0.0).mean() > 0.3 and slides.max() > 3.0 and abs(slides.mean() - 1.0) < 0.1 else 1)
P
"$folder/venv/bin/python" "$folder/show.py"
