"""What Drake takes of an exported robot."""

import json
import logging
import sys

from pydrake.geometry import SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

RATIO, ARMATURE, VISCOUS, LIMIT = 3.0, 1e-3, 2e-3, 0.2  # of roll_1 in SINGLE


class Warnings(logging.Handler):
    """Everything that Drake says while it reads."""

    def __init__(self) -> None:
        super().__init__()
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.said.append(record.getMessage())


def read(file):
    log = Warnings()
    logging.getLogger("drake").handlers = [log]
    logging.getLogger("drake").propagate = False
    plant, scene = MultibodyPlant(2e-3), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene)
    Parser(plant).AddModels(file)
    plant.Finalize()
    return plant, scene, " ".join(log.said)


def dropped(said, *words):
    return "dropped, with a warning" if any(word in said for word in words) else "dropped, without a word"


single, scene, said = read(sys.argv[1])
coupled, _, said_of_coupled = read(sys.argv[2])
actuators = {
    single.get_joint_actuator(i).name(): single.get_joint_actuator(i) for i in single.GetJointActuatorIndices()
}
names = [coupled.get_joint_actuator(i).name() for i in coupled.GetJointActuatorIndices()]
roll = actuators["roll_1"]
context = single.CreateDefaultContext()
joint = single.GetJointByName("roll_1")
start = joint.velocity_start()
port = single.get_actuation_input_port()
matrix = single.MakeActuationMatrix()
torque_of_one = float(matrix[start, roll.input_start()])
inertia_dropped_with_motor = all(
    coupled.GetJointByName(f"roll_{i}").num_velocities() == 1 and f"roll_{i}" not in names for i in (1, 2, 3, 4)
)
inspector = scene.model_inspector()
frictions = {
    inspector.GetProximityProperties(g).GetProperty("material", "coulomb_friction").static_friction()
    for g in inspector.GetAllGeometryIds()
    if inspector.GetProximityProperties(g) is not None
}
rotor = roll.default_rotor_inertia() * roll.default_gear_ratio() ** 2
facts = {
    "masses and inertias": f"taken, {single.CalcTotalMass(context):.4g} kg",
    "motors of one joint": f"taken, {len(actuators)} of 6",
    "their gear": f"taken for inertia alone: a torque of 1 gives {torque_of_one:g} at the joint, not {RATIO:g}",
    "their limits": f"taken, {roll.effort_limit():g} N m"
    if abs(roll.effort_limit() - LIMIT) < 1e-12
    else f"{roll.effort_limit():g}",
    "motors of two joints": f"{dropped(said_of_coupled, 'will be ignored')}; {len(names)} of 8 are left",
    "armature of joints": f"{rotor:.4g} kg m² of {ARMATURE:g}; without its motor dropped, without a word"
    if inertia_dropped_with_motor
    else f"{rotor:.4g}",
    "rotors of two joints (armature of a tendon)": dropped(said_of_coupled, "tag 'tendon'"),
    "damping of joints": f"taken, {joint.default_damping_vector()[0]:g} of {VISCOUS:g} N m s",
    "dry friction of joints": dropped(said, "frictionloss"),
    "scrub (damping of a tendon)": dropped(said, "tag 'tendon'"),
    "wheels on the floor": f"friction taken, {max(frictions):g}; cone, solref, time step dropped",
    "platform as drawn": dropped(said_of_coupled, "mesh"),
}
print(json.dumps(facts))
