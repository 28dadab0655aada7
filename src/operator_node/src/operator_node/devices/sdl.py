"""SDL by pygame, without its windows and sounds."""

import os
from typing import Any

from custom_ros_tools.errors import MissingDependency

SETTINGS = {
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",  # it would wait for a window of its own to be typed into
    "SDL_NO_SIGNAL_HANDLERS": "1",
    "SDL_VIDEODRIVER": "dummy",
}


def pygame_with_joysticks() -> Any:
    """Returns pygame with its joysticks switched on, which it finds from then on, and loses, with its events.

    Raises:
        MissingDependency: If pygame is not installed.
    """
    os.environ.update(SETTINGS)
    try:
        import pygame
        from pygame._sdl2 import controller
    except ModuleNotFoundError as error:
        raise MissingDependency(str(error.name), "apt install python3-pygame") from None
    pygame.display.init()  # which its events need
    pygame.joystick.init()
    controller.init()
    return pygame


def triggers_of(index: int) -> frozenset[int]:
    """Returns which axes of the joystick of an index rest at one end, by SDL's table of gamepads."""
    from pygame._sdl2 import controller

    if not controller.is_controller(index):
        return frozenset()
    mapping = controller.Controller(index).get_mapping()
    names = (mapping.get(key, "") for key in ("lefttrigger", "righttrigger"))
    return frozenset(int(name[1:]) for name in names if name[:1] == "a" and name[1:].isdecimal())
