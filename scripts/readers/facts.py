"""The questions that every probe answers, and the readers with the packages that are installed to ask them."""

FACTS = (
    "masses and inertias",
    "motors of one joint",
    "their gear",
    "their limits",
    "motors of two joints",
    "armature of joints",
    "rotors of two joints (armature of a tendon)",
    "damping of joints",
    "dry friction of joints",
    "scrub (damping of a tendon)",
    "wheels on the floor",
    "platform as drawn",
)
READERS = {  # name: (probe, packages as pip wants them)
    "MuJoCo 4.0.0": ("probe_mujoco", ("mujoco==4.0.0",)),
    "MJX 3.17.0": ("probe_mjx", ("mujoco-mjx==3.17.0", "jax==0.10.2", "jaxlib==0.10.2")),
    "MuJoCo Warp 4.0.0": ("probe_mujoco_warp", ("mujoco-warp==4.0.0", "mujoco==4.0.0", "warp-lang==1.19.0")),
    "Newton 1.8.0": ("probe_newton", ("newton==1.8.0", "mujoco-warp==4.0.0", "mujoco==4.0.0", "warp-lang==1.19.0")),
    "Drake 1.51.1": ("probe_drake", ("drake==1.51.1",)),
    "Pinocchio 4.1.0": ("probe_pinocchio", ("pin==4.1.0",)),
}
