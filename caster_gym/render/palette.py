"""The colours of all pictures: few, on a light ground, and distinct for colour-blind people."""

from typing import TypeAlias

Colour: TypeAlias = tuple[int, int, int]

PAPER: Colour = (255, 255, 255)
GROUND: Colour = (247, 248, 250)  # of the floor, outside the corridor
GRID: Colour = (236, 239, 243)
RULE: Colour = (217, 222, 229)  # thin lines that part one thing from another
CORRIDOR: Colour = (255, 255, 255)
CORRIDOR_EDGE: Colour = (208, 215, 224)
ICE: Colour = (204, 231, 248)  # patches of the floor with less friction than around them
ICE_EDGE: Colour = (143, 192, 224)
ROUGH: Colour = (240, 228, 204)  # and with more
ROUGH_EDGE: Colour = (206, 184, 140)
PATH: Colour = (150, 161, 175)
TRACE: Colour = (0, 114, 178)
BODY: Colour = (52, 92, 140)
GHOST: Colour = (120, 132, 148)  # of the reference pose
WHEEL: Colour = (38, 43, 51)
LINK: Colour = (112, 124, 139)
FORCE: Colour = (0, 158, 115)
SLIP: Colour = (204, 121, 167)  # of wheels that slip
IMPACT: Colour = (213, 62, 40)
FAILED: Colour = (200, 48, 48)
SOLID: Colour = (205, 210, 217)  # of obstacles
SOLID_EDGE: Colour = (122, 132, 145)
CENTRE: Colour = (255, 176, 0)  # the robot's reference point C, and nothing else
INK: Colour = (38, 43, 51)
FAINT_INK: Colour = (116, 126, 139)
