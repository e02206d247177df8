"""Imports pygame-ce, or raises an error that says how to install it."""

import os
import warnings

from gymnasium.error import DependencyNotInstalled

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # it greets on standard output otherwise
try:
    with warnings.catch_warnings():
        # pygame-ce 2.5.0 imports pkg_resources, where that is installed
        warnings.filterwarnings("ignore", "pkg_resources is deprecated", Warning)
        import pygame
except ImportError as error:
    raise DependencyNotInstalled(
        "drawing needs pygame-ce, which is not installed: pip install 'caster_gym[render]'"
    ) from error

__all__ = ["pygame"]
