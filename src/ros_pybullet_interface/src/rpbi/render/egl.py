"""Gives PyBullet's EGL renderer a depth buffer of 24 bits.

PyBullet's EGL plugin requests a depth buffer of at least 8 bits, for which Mesa chooses 16 bits. With a near plane at
1 cm, the depth of a wall at 2 m is then wrong by up to 3 mm. After the plugin was loaded and before shapes are loaded,
this module therefore replaces the plugin's context by a context with a 24-bit depth buffer. The new context shares the
plugin's shaders and textures. From then on, the calling thread draws to the new context's surface.
"""

import ctypes
import logging
from ctypes import c_char_p, c_int, c_uint, c_void_p
from typing import Any

import numpy as np
import numpy.typing as npt

log = logging.getLogger(__name__)

DEPTH_BITS = 24
WINDOW_PX = (1024, 768)
"""Columns and rows of the plugin's hidden window, the largest image that PyBullet draws [px]."""

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
    """The EGL context that is current in the calling thread.

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
        """Returns the name of the renderer, as reported by the OpenGL driver."""
        text = self._gl("glGetString", c_char_p, c_uint)(_GL_RENDERER)
        return text.decode(errors="replace") if text else "unknown"

    def read_depth(self, width_px: int, height_px: int) -> npt.NDArray[np.float32]:
        """Returns the depth buffer after the last drawing pass, shape (height, width), with the top row first.

        PyBullet draws at most `WINDOW_PX`, and repeats pixels for larger images. This method repeats depths in the same
        way.
        """
        columns, rows = min(width_px, WINDOW_PX[0]), min(height_px, WINDOW_PX[1])
        depth = np.empty((rows, columns), np.float32)
        read = self._gl("glReadPixels", None, c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)
        read(0, 0, columns, rows, _GL_DEPTH_COMPONENT, _GL_FLOAT, depth.ctypes.data)
        at_row, at_column = np.arange(height_px) * rows // height_px, np.arange(width_px) * columns // width_px
        return depth[at_row[:, None], at_column][::-1]

    def deepen(self, width_px: int, height_px: int) -> None:
        """Creates a context with a 24-bit depth buffer and makes it current; call this method before shapes are loaded.

        Args:
            width_px: Maximum number of columns of an image.
            height_px: Maximum number of rows of an image.

        Raises:
            EglError: If EGL cannot create such a context; the old context then stays current.
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
        """Creates a drawing surface of another size and makes it current; `deepen` must have been called before.

        Raises:
            EglError: If EGL cannot create such a surface; the old surface then stays current.
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
        """Returns the OpenGL function `name`; `result` and `arguments` are the ctypes types of its signature."""
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
