"""A tuple of arrays that is passed to compiled code as one reference.

A call of compiled code takes every array of a tuple apart, which costs a microsecond for a dozen of them: as much as
two time steps of a robot.
"""

from typing import Any

from numba import types
from numba.experimental import structref

from caster_gym.engines.native.compilation import Work
from caster_gym.engines.native.compiler import compiled


@structref.register
class HeldType(types.StructRef):
    """What compiled code knows of a `Held`."""


class Held(structref.StructRefProxy):
    """Holds a tuple; `content` gives it back in compiled code."""

    def __new__(cls, content: Any) -> Any:
        return _hold(content)


_define: Any = structref.define_proxy  # Numba ships it without types
_define(Held, HeldType, ["content"])


def _holding(content: Any) -> Any:
    return Held(content)


def _described(_types: tuple[Any, ...]) -> Work:
    return Work("robots that are stepped one by one", 1.0)


_hold = compiled(_holding, _described)
