#!/usr/bin/env bash
# Drake 1.51.1 reads MJCF: <motor joint="j" gear="3"/> multiplies no torque. In MuJoCo a control of 1 gives 3 N m at the
# joint; in Drake an actuation of 1 gives 1 N m, and the gear only reflects the rotor's inertia.
# Guess before running: 3 N m in both.
# Seen: "MuJoCo 3, Drake 1 N m at the joint". Exits 1 if that changes.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" && "$folder/venv/bin/python" -m pip install --quiet "drake==1.51.1" "mujoco==4.0.0" 2>/dev/null
cat > "$folder/show.py" <<'P'
import logging, sys
import mujoco
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
logging.getLogger("drake").setLevel(logging.ERROR)
model = """<mujoco model="m"><worldbody><body><joint name="j" type="hinge" axis="0 0 1"/>
<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/></body></worldbody>
<actuator><motor name="m" joint="j" gear="3"/></actuator></mujoco>"""
plant = MultibodyPlant(0.0)
Parser(plant).AddModelsFromString(model, "xml")
plant.Finalize()
m = mujoco.MjModel.from_xml_string(model); d = mujoco.MjData(m); d.ctrl[:] = 1.0; mujoco.mj_forward(m, d)
here, there = float(d.qfrc_actuator[0]), float(plant.MakeActuationMatrix()[0, 0])
print(f"MuJoCo {here:g}, Drake {there:g} N m at the joint for a control of 1 through gear 3")
sys.exit(0 if (here, there) == (3.0, 1.0) else 1)
P
"$folder/venv/bin/python" "$folder/show.py"
