"""Which OpenGL back end renders without a display: EGL, else OSMesa (macOS: CGL, else GLFW).

MuJoCo picks its back end from ``MUJOCO_GL`` while it is being imported, and falls over with an unrelated
error if the library is missing. Here the libraries are probed with ctypes alone, so that it does not matter
when MuJoCo was imported, and so that a missing library ends in a sentence that says what to install.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import functools
import os
import platform
from typing import Any

from punnet.errors import RenderingError

__all__ = ["INSTALL_COMMAND", "gl_backend", "make_gl_context"]

INSTALL_COMMAND = "sudo apt-get install -y libegl1 libgl1 libgl1-mesa-dri"
_OSMESA_COMMAND = "sudo apt-get install -y libosmesa6 libgl1"

_EGL_PLATFORM_DEVICE = 0x313F  # EGL_PLATFORM_DEVICE_EXT
_MAX_DEVICES = 16
_SWITCHED_OFF = ("disable", "disabled", "off", "false", "0")
_AUTOMATIC = ("", "enable", "enabled", "on", "true", "1")


@functools.lru_cache(maxsize=1)
def gl_backend() -> str:
    """Name of the back end that renders here: ``egl``, ``osmesa``, ``cgl`` or ``glfw``.

    ``MUJOCO_GL`` decides if it is set; else the first that works is taken.

    Raises
    ------
    RenderingError
        If none works, or not the one that ``MUJOCO_GL`` names; says what to install.
    """
    wanted = os.environ.get("MUJOCO_GL", "").lower().strip()
    if wanted in _SWITCHED_OFF:
        raise RenderingError(f"rendering is switched off by MUJOCO_GL={wanted}; unset it to see anything")
    probes = _DARWIN_PROBES if platform.system() == "Darwin" else _LINUX_PROBES
    if wanted in _AUTOMATIC:
        chosen = list(probes)
    elif wanted in probes:
        chosen = [wanted]
    else:
        raise RenderingError(
            f"MUJOCO_GL={wanted} is not known here; unset it, or use one of: {', '.join(probes)}"
        )
    failures = []
    for name in chosen:
        problem = probes[name]()
        if problem is None:
            return name
        failures.append(f"{name}: {problem}")
    raise RenderingError(_advice(failures, wanted))


def _advice(failures: list[str], wanted: str) -> str:
    if platform.system() == "Darwin":
        remedy = "unset MUJOCO_GL, or set it to cgl or glfw"
    elif wanted == "osmesa":
        remedy = f"install libosmesa6: {_OSMESA_COMMAND}"
    else:
        remedy = (
            f"install libegl1, libgl1 and libgl1-mesa-dri: {INSTALL_COMMAND}  "
            f"(or libosmesa6, slower to be found but as good: {_OSMESA_COMMAND})"
        )
    return f"no OpenGL for rendering without a display ({'; '.join(failures)}); {remedy}"


def make_gl_context(width: int, height: int) -> Any:
    """Make a MuJoCo GL context of :func:`gl_backend`, not yet current; free it with its ``free``.

    Raises
    ------
    RenderingError
        If the back end was found but can't make a context.
    """
    name = gl_backend()
    if name in ("egl", "osmesa"):
        # MuJoCo's two headless modules refuse to be imported while this names anything but themselves.
        os.environ["PYOPENGL_PLATFORM"] = name
    try:
        context_class = _context_class(name)
        return context_class(width, height)
    except Exception as error:  # PyOpenGL raises a dozen unrelated kinds when a library is incomplete
        raise RenderingError(_advice([f"{name}: {type(error).__name__}: {error}"], name)) from error


def _context_class(name: str) -> Any:
    """Take out the class' ``__del__``: the owner frees it, after what was allocated inside it."""
    module = __import__(f"mujoco.{name}", fromlist=["GLContext"])
    return type("OwnedGLContext", (module.GLContext,), {"__del__": lambda self: None})


def _probe_egl() -> str | None:
    """None if EGL can start a display without a screen, else what is missing."""
    problem = _probe_desktop_gl()
    try:
        egl = ctypes.CDLL(ctypes.util.find_library("EGL") or "libEGL.so.1")
        egl.eglGetProcAddress.restype = ctypes.c_void_p
        egl.eglGetProcAddress.argtypes = [ctypes.c_char_p]
    except (OSError, AttributeError):
        return "libEGL.so.1 is not installed"
    if problem is not None:
        return problem
    query = _egl_extension(
        egl, b"eglQueryDevicesEXT", ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p
    )
    display_of = _egl_extension(
        egl, b"eglGetPlatformDisplayEXT", ctypes.c_void_p, ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p
    )
    if query is None or display_of is None:
        return "this libEGL can't open a device without a display"
    devices, count = (ctypes.c_void_p * _MAX_DEVICES)(), ctypes.c_int(0)
    if not query(_MAX_DEVICES, devices, ctypes.byref(count)) or count.value == 0:
        return "libEGL finds no device, not even Mesa's software one"
    egl.eglInitialize.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
    for device in devices[: count.value]:
        display = display_of(_EGL_PLATFORM_DEVICE, device, None)
        if display and egl.eglInitialize(display, None, None):
            return None  # left initialised: MuJoCo opens the same display again
    return f"none of EGL's {count.value} devices starts (Mesa's drivers are missing)"


def _egl_extension(egl: Any, name: bytes, result: Any, *arguments: Any) -> Any:
    address = egl.eglGetProcAddress(name)
    return ctypes.CFUNCTYPE(result, *arguments)(address) if address else None


def _probe_desktop_gl() -> str | None:
    """PyOpenGL takes its entry points from one of these two; without them it fails with an AttributeError."""
    if ctypes.util.find_library("OpenGL") or ctypes.util.find_library("GL"):
        return None
    return "neither libGL.so.1 nor libOpenGL.so.0 is installed"


def _probe_osmesa() -> str | None:
    return None if ctypes.util.find_library("OSMesa") else "libOSMesa is not installed"


def _probe_cgl() -> str | None:
    return None if ctypes.util.find_library("OpenGL") else "the OpenGL framework is missing"


def _probe_glfw() -> str | None:
    """GLFW needs a screen; on Linux it is used only if asked for."""
    if platform.system() != "Darwin" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return "GLFW needs a display (DISPLAY is not set)"
    try:
        import glfw
    except ImportError as error:
        return f"the Python package glfw can't be imported ({error})"
    return None if glfw.init() else "GLFW can't be initialised"


_LINUX_PROBES = {"egl": _probe_egl, "osmesa": _probe_osmesa, "glfw": _probe_glfw}
_DARWIN_PROBES = {"cgl": _probe_cgl, "glfw": _probe_glfw}
