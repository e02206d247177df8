#!/usr/bin/env bash
# Drake 1.51.1 reads MJCF: a joint's rotor inertia (armature="…", an attribute of the joint) is kept only if some <motor>
# names that joint. With the motor on a fixed tendon over the joint, the motor is dropped with a warning, and the joint's
# armature is dropped without a word: the same torque then accelerates the joint 1.9 times as fast.
# Guess before running: the motor is lost, the armature, an attribute of the joint, is kept.
# Seen: "motor on the joint: 1 actuator, mass matrix 0.0021; on a tendon: 0, 0.0011 kg m²". Exits 1 if that changes.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" && "$folder/venv/bin/python" -m pip install --quiet "drake==1.51.1" 2>/dev/null
cat > "$folder/show.py" <<'P'
import logging, sys
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
logging.getLogger("drake").setLevel(logging.ERROR)
model = """<mujoco model="m"><worldbody><body><joint name="j" type="hinge" axis="0 0 1" armature="0.001"/>
<inertial mass="1" pos="0 0 0" diaginertia="0.0011 0.0011 0.0011"/></body></worldbody>{tendon}
<actuator><motor name="m" {on}="{name}"/></actuator></mujoco>"""
tendon = '<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>'
def inertia(text):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text, "xml")
    plant.Finalize()
    return plant.num_actuators(), float(plant.CalcMassMatrix(plant.CreateDefaultContext())[0, 0])
joint = inertia(model.format(tendon="", on="joint", name="j"))
cable = inertia(model.format(tendon=tendon, on="tendon", name="t"))
print(f"motor on the joint: {joint[0]} actuator, mass matrix {joint[1]:.4f}; on a tendon: {cable[0]}, {cable[1]:.4f} kg m²")
sys.exit(0 if joint[0] == 1 and cable[0] == 0 and abs(joint[1] - 0.0021) + abs(cable[1] - 0.0011) < 1e-12 else 1)
P
"$folder/venv/bin/python" "$folder/show.py"
