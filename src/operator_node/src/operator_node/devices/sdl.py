"""SDL joysticks through pygame, without windows and sound."""

import os
from typing import Any

from custom_ros_tools.errors import MissingDependency

SETTINGS = {
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",  # otherwise it only reads while a window of its own has the focus
    "SDL_NO_SIGNAL_HANDLERS": "1",
    "SDL_VIDEODRIVER": "dummy",
}


def pygame_with_joysticks() -> Any:
    """Returns pygame with joysticks enabled; from then on its events report joysticks that come and go.

    Raises:
        MissingDependency: If pygame is not installed.
    """
    os.environ.update(SETTINGS)
    try:
        import pygame
        from pygame._sdl2 import controller
    except ModuleNotFoundError as error:
        raise MissingDependency(str(error.name), "apt install python3-pygame") from None
    pygame.display.init()  # needed by its events
    pygame.joystick.init()
    controller.init()
    return pygame


def triggers_of(index: int) -> frozenset[int]:
    """Returns the axes of a joystick, by its index, that rest at one end, according to SDL's table of gamepads."""
    from pygame._sdl2 import controller

    if not controller.is_controller(index):
        return frozenset()
    mapping = controller.Controller(index).get_mapping()
    names = (mapping.get(key, "") for key in ("lefttrigger", "righttrigger"))
    return frozenset(int(name[1:]) for name in names if name[:1] == "a" and name[1:].isdecimal())
