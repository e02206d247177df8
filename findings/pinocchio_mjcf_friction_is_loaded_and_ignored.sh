#!/usr/bin/env bash
# Pinocchio 4.1.0 loads damping and frictionloss of MJCF joints into model.damping and model.upperDryFrictionLimit, but its
# forward dynamics (aba) ignores both, while it does use model.armature, which stands beside them.
# Guess before running: what a model holds, its forward dynamics uses, at least the linear damping.
# Seen: "loaded damping, frictionloss, armature: (0.5, 0.25, 0.1); acceleration at 1 rad/s without torque 0, with 1 N m
# 0.9091 = 1/(1 + armature)". Exits 1 if that changes.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" && "$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" 2>/dev/null
cat > "$folder/model.xml" <<'X'
<mujoco><worldbody><body name="b"><joint name="j" type="hinge" axis="0 0 1" damping="0.5" frictionloss="0.25" armature="0.1"/>
<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/></body></worldbody></mujoco>
X
cat > "$folder/show.py" <<'P'
import sys
import numpy as np
import pinocchio as pin
model = pin.buildModelFromMJCF(sys.argv[1])
loaded = float(model.damping[0]), float(model.upperDryFrictionLimit[0]), float(model.armature[0])
free = float(pin.aba(model, model.createData(), pin.neutral(model), np.ones(1), np.zeros(1))[0])
pushed = float(pin.aba(model, model.createData(), pin.neutral(model), np.ones(1), np.ones(1))[0])
print(f"loaded damping, frictionloss, armature: {loaded}; acceleration at 1 rad/s without torque {free:g}, "
      f"with 1 N m {pushed:.4f} = 1/(1 + armature)")
sys.exit(0 if loaded == (0.5, 0.25, 0.1) and free == 0.0 and abs(pushed - 1 / 1.1) < 1e-12 else 1)
P
"$folder/venv/bin/python" "$folder/show.py" "$folder/model.xml"
