"""What MuJoCo takes of an exported robot: all of it, which the other readers are measured by."""

import json
import sys

import mujoco

model, coupled = (mujoco.MjModel.from_xml_path(file) for file in sys.argv[1:3])
tendon = int((coupled.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON).sum())
roll = model.joint("roll_1").dofadr[0]
print(
    json.dumps(
        {
            "masses and inertias": f"taken, {model.body_mass.sum():.4g} kg",
            "motors of one joint": f"taken, {model.nu} of 6",
            "their gear": f"taken, {model.actuator_gear[0, 0]:g}",
            "their limits": f"taken, {model.actuator_ctrlrange[0, 1]:g} N m",
            "motors of two joints": f"taken, {tendon} of 4",
            "armature of joints": f"taken, {model.dof_armature[roll]:g} kg m²",
            "rotors of two joints (armature of a tendon)": f"taken, {coupled.tendon_armature.max():.4g} kg m²",
            "damping of joints": f"taken, {model.dof_damping.reshape(model.nv, -1)[roll, 0]:g} N m s",
            "dry friction of joints": f"taken, {model.dof_frictionloss[roll]:g} N m",
            "scrub (damping of a tendon)": f"taken, {model.tendon_damping.reshape(model.ntendon, -1)[0, 0]:g} N m s",
            "wheels on the floor": "taken; a scene that it is attached to keeps its own cone, impratio and time step",
            "platform as drawn": "taken" if coupled.nmesh == 1 else "dropped",
        }
    )
)
