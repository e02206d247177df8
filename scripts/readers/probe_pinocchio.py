"""What Pinocchio takes of an exported robot."""

import json
import sys

import numpy as np
import pinocchio as pin

ARMATURE, VISCOUS, COULOMB = 1e-3, 2e-3, 3e-3  # of roll_1 in SINGLE

model = pin.buildModelFromMJCF(sys.argv[1])
coupled = pin.buildModelFromMJCF(sys.argv[2])
roll = model.joints[model.getJointId("roll_1")].idx_v
rates, rest = np.ones(model.nv), np.zeros(model.nv)


def accelerations(of):
    return pin.aba(of, of.createData(), pin.neutral(of), rates, rest).copy()


def felt(field):
    """Does the forward dynamics change when a field is set to zero?"""
    other = model.copy()
    setattr(other, field, 0.0 * getattr(other, field))
    return bool(np.abs(accelerations(other) - accelerations(model)).max() > 1e-9)


def friction(field, value):
    word = f"loaded, {getattr(model, field)[roll]:g} of {value:g}"
    return f"taken: {word}" if felt(field) else f"{word}, but `aba` ignores it"


at_joint = float(coupled.armature[coupled.joints[coupled.getJointId("roll_1")].idx_v])
armature = f"{'taken' if felt('armature') else 'ignored'}, {model.armature[roll]:g} of {ARMATURE:g}"
limit = float(model.upperEffortLimit[roll])
geometry = pin.buildGeomFromMJCF(coupled, sys.argv[2], pin.GeometryType.VISUAL)
collision = pin.buildGeomFromMJCF(model, sys.argv[1], pin.GeometryType.COLLISION)
print(
    json.dumps(
        {
            "masses and inertias": f"taken, {sum(body.mass for body in model.inertias):.4g} kg",
            "motors of one joint": "none: torques are given at the joints",
            "their gear": "dropped with the motors",
            "their limits": f"dropped, without a word: {limit:g} N m",
            "motors of two joints": "none: torques are given at the joints",
            "armature of joints": armature,
            "rotors of two joints (armature of a tendon)": f"dropped, without a word: {at_joint:g} kg m² at the joint",
            "damping of joints": friction("damping", VISCOUS),
            "dry friction of joints": f"loaded, {model.upperDryFrictionLimit[roll]:g} of {COULOMB:g}, "
            "but `aba` ignores it",
            "scrub (damping of a tendon)": "dropped, without a word",
            "wheels on the floor": f"{collision.ngeoms} shapes taken; friction, cone, solref and time step dropped",
            "platform as drawn": "taken"
            if any("platform" in str(g.name) for g in geometry.geometryObjects)
            else "dropped",
        }
    )
)
