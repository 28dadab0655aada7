"""A better depth buffer for PyBullet's EGL renderer.

The plugin asks EGL for a depth buffer of 8 bits or more, and Mesa answers with the smallest it has, 16 bits: with a
near plane at 1 cm a wall at 2 m is then off by up to 3 mm. This module therefore replaces the plugin's context by one
with 24 bits, right after the plugin was loaded and before it has any shapes. The new context shares the plugin's
shaders and textures, and everything drawn or read from now on in this thread uses its surface.
"""

import ctypes
import logging
from ctypes import c_char_p, c_int, c_uint, c_void_p
from typing import Any

import numpy as np
import numpy.typing as npt

log = logging.getLogger(__name__)

DEPTH_BITS = 24

# From the Khronos headers egl.h and gl.h.
_CONFIG_ID, _NONE = 0x3028, 0x3038
_BLUE, _GREEN, _RED, _DEPTH = 0x3022, 0x3023, 0x3024, 0x3025
_SURFACE_TYPE, _PBUFFER_BIT = 0x3033, 0x0001
_RENDERABLE_TYPE, _OPENGL_BIT = 0x3040, 0x0008
_HEIGHT, _WIDTH, _DRAW = 0x3056, 0x3057, 0x3059
_GL_RENDERER, _GL_DEPTH_COMPONENT, _GL_FLOAT = 0x1F01, 0x1902, 0x1406


class EglError(RuntimeError):
    """A call of EGL failed."""


class Egl:
    """The EGL context that is current in this thread.

    Raises:
        EglError: If there is no EGL library or no current context.
    """

    def __init__(self) -> None:
        try:
            self._egl = ctypes.CDLL("libEGL.so.1")
        except OSError as error:
            raise EglError(str(error)) from error
        self._display = self._call("eglGetCurrentDisplay", c_void_p)
        self._context = self._call("eglGetCurrentContext", c_void_p)
        self._config = c_void_p()
        if not self._context:
            raise EglError("there is no current EGL context")

    def renderer(self) -> str:
        """Returns the driver's name of the renderer."""
        text = self._gl("glGetString", c_char_p, c_uint)(_GL_RENDERER)
        return text.decode(errors="replace") if text else "unknown"

    def read_depth(self, width_px: int, height_px: int) -> npt.NDArray[np.float32]:
        """Returns the depth buffer as the last pass has left it, shape (height, width), its first row on top."""
        depth = np.empty((height_px, width_px), np.float32)
        read = self._gl("glReadPixels", None, c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)
        read(0, 0, width_px, height_px, _GL_DEPTH_COMPONENT, _GL_FLOAT, depth.ctypes.data)
        return depth[::-1]

    def deepen(self, width_px: int, height_px: int) -> None:
        """Makes a context with a deep enough depth buffer current; call it before any shape is loaded.

        Args:
            width_px: Columns of the widest image that will be drawn.
            height_px: Rows of the highest.

        Raises:
            EglError: If EGL has none; the old context is then still current.
        """
        wanted = [_RED, 8, _GREEN, 8, _BLUE, 8, _DEPTH, DEPTH_BITS]
        wanted += [_SURFACE_TYPE, _PBUFFER_BIT, _RENDERABLE_TYPE, _OPENGL_BIT, _NONE]
        count = c_int()
        config = ctypes.byref(self._config)
        if not self._call(
            "eglChooseConfig", c_uint, self._display, _integers(wanted), config, c_int(1), ctypes.byref(count)
        ):
            raise EglError("EGL has no such configuration")
        surface = self._surface(width_px, height_px)
        none = _integers([_NONE])
        context = self._call("eglCreateContext", c_void_p, self._display, self._config, self._context, none)
        if not (count.value and surface and context):
            raise EglError("EGL cannot make a surface or context")
        self._use(surface, context)

    def resize(self, width_px: int, height_px: int) -> None:
        """Makes a surface of another size current; needs `deepen` before.

        Raises:
            EglError: If EGL has none; the old one is then still current.
        """
        surface = self._surface(width_px, height_px)
        if not (self._config and surface):
            raise EglError(f"EGL cannot make a surface of {width_px} x {height_px} pixels")
        self._use(surface, self._context)

    def _surface(self, width_px: int, height_px: int) -> int | None:
        size = _integers([_WIDTH, width_px, _HEIGHT, height_px, _NONE])
        surface: int | None = self._call("eglCreatePbufferSurface", c_void_p, self._display, self._config, size)
        return surface

    def _use(self, surface: int | None, context: int | None) -> None:
        if not self._call("eglMakeCurrent", c_uint, self._display, surface, surface, context):
            raise EglError("EGL cannot make the context current")
        self._context = context

    def _gl(self, name: str, result: Any, *arguments: Any) -> Any:
        """Returns a function of OpenGL."""
        address = self._call("eglGetProcAddress", c_void_p, c_char_p(name.encode()))
        if not address:
            raise EglError(f"the driver has no {name}")
        return ctypes.CFUNCTYPE(result, *arguments)(address)

    def _call(self, name: str, result: Any, *arguments: Any) -> Any:
        function = getattr(self._egl, name)
        function.restype = result
        return function(*(c_void_p(value) if isinstance(value, int) else value for value in arguments))


def _integers(values: list[int]) -> Any:
    return (c_int * len(values))(*values)
