"""What Newton takes of an exported robot: its own arrays, and those that its solvers other than MuJoCo's do not use."""

import contextlib
import json
import sys

import warp

warp.config.quiet = True
with contextlib.redirect_stdout(sys.stderr):
    import newton

    def read(file):
        """The model, or the error of who lacks a package that the reader needs for it."""
        builder = newton.ModelBuilder()
        newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        builder.add_mjcf(file)
        return builder, builder.finalize()

    builder, single = read(sys.argv[1])
    _, coupled = read(sys.argv[2])

    def number(array, place=-1):
        return float(array.numpy().reshape(-1)[place])

    # the last joint of the model is roll_3
    tendon_damping = single.mujoco.tendon_damping.numpy().reshape(-1)
    kinds = [int(kind) for kind in coupled.mujoco.actuator_trntype.numpy()]
    limits = single.mujoco.actuator_ctrlrange.numpy()
    damping = next(
        (getattr(single, name) for name in ("joint_damping", "joint_target_kd") if number(getattr(single, name)) > 0.0),
        None,
    )
    held = getattr(coupled.mujoco, "tendon_armature", None)
    armature = 0.0 if held is None else float(held.numpy().max())
    facts = {
        "masses and inertias": f"taken, {single.body_mass.numpy().sum():.4g} kg",
        "motors of one joint": f"taken as attributes of its MuJoCo solver, {len(limits)} of 6",
        "their gear": f"as these, {number(single.mujoco.actuator_gear, 0):g}",
        "their limits": f"as these, {limits[0].tolist()[-1]:.4g} N m; "
        f"joint_effort_limit {number(single.joint_effort_limit):g}",
        "motors of two joints": f"as these, {sum(kind != kinds[1] for kind in kinds)} of 4",
        "armature of joints": f"taken, {number(single.joint_armature):g} kg m²",
        "rotors of two joints (armature of a tendon)": f"as motors, {armature:.4g} kg m²"
        if armature > 0.0
        else "dropped, without a word",
        "damping of joints": "dropped" if damping is None else f"taken, {number(damping):g} N m s",
        "dry friction of joints": f"taken, {number(single.joint_friction):g} N m",
        "scrub (damping of a tendon)": f"as motors, {max(tendon_damping):g} N m s",
        "wheels on the floor": f"friction taken, {number(single.shape_material_mu):g}",
        "platform as drawn": "taken, without SciPy",
    }
print(json.dumps(facts))
