"""pygame-ce, or a sentence that says how to get it."""

import os

from gymnasium.error import DependencyNotInstalled

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # it greets on standard output otherwise
try:
    import pygame
except ImportError as error:
    raise DependencyNotInstalled(
        "drawing needs pygame-ce, which is not installed: pip install 'caster_gym[render]'"
    ) from error

__all__ = ["pygame"]
