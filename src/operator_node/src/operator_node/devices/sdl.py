"""Access to SDL joysticks through pygame, without windows and sound."""

import os
from typing import Any

from custom_ros_tools.errors import MissingDependency

SETTINGS = {
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",  # otherwise SDL reads joysticks only while its window has the focus
    "SDL_NO_SIGNAL_HANDLERS": "1",
    "SDL_VIDEODRIVER": "dummy",
}


def pygame_with_joysticks() -> Any:
    """Enables joysticks in pygame, and returns the module pygame.

    Afterwards, pygame's events report when a joystick is plugged in or unplugged.

    Raises:
        MissingDependency: If pygame is not installed.
    """
    os.environ.update(SETTINGS)
    try:
        import pygame
        from pygame._sdl2 import controller
    except ModuleNotFoundError as error:
        raise MissingDependency(str(error.name), "apt install python3-pygame") from None
    pygame.display.init()  # needed for pygame's events
    pygame.joystick.init()
    controller.init()
    return pygame


def triggers_of(index: int) -> frozenset[int]:
    """Returns the indices of a joystick's trigger axes, according to SDL's table of gamepads.

    Args:
        index: Index of the joystick in SDL. The result is empty if SDL does not know the joystick as a gamepad.
    """
    from pygame._sdl2 import controller

    if not controller.is_controller(index):
        return frozenset()
    mapping = controller.Controller(index).get_mapping()
    names = (mapping.get(key, "") for key in ("lefttrigger", "righttrigger"))
    return frozenset(int(name[1:]) for name in names if name[:1] == "a" and name[1:].isdecimal())
