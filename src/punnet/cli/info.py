"""``punnet info``: what to attach to a bug report."""

from __future__ import annotations

import os
import platform
from importlib import metadata
from typing import Any

import typer

from punnet import __version__
from punnet.cli.console import print_json, say
from punnet.cli.options import Json
from punnet.errors import BundleError, RenderingError

__all__ = ["register"]

PACKAGES = (
    "numpy",
    "scipy",
    "opencv-python-headless",
    "onnxruntime",
    "mujoco",
    "ruckig",
    "matplotlib",
)
GIBIBYTE = 1024.0**3


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(epilog="Example: punnet info --json > info.json")(info)


def info(as_json: Json = False) -> None:
    """Show versions, system, OpenGL back end, cores, memory and model bundles."""
    facts = _facts()
    if as_json:
        print_json(facts)
        return
    for name, value in facts.items():
        say(f"{name:<10} {_in_words(value)}")


def _in_words(value: Any) -> str:
    if isinstance(value, dict):
        value = [f"{key} {entry}" for key, entry in value.items()]
    return ", ".join(value) if isinstance(value, list) else str(value)


def _facts() -> dict[str, Any]:
    return {
        "punnet": __version__,
        "python": f"{platform.python_version()} ({platform.python_implementation()})",
        "system": f"{platform.platform()}",
        "cores": _cores(),
        "memory": f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / GIBIBYTE:.1f} GiB",
        "opengl": _gl_backend(),
        "bundles": _bundles(),
        "packages": {name: _version(name) for name in PACKAGES},
    }


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "missing"


def _gl_backend() -> str:
    from punnet.sim.gl_context import gl_backend

    try:
        return gl_backend()
    except RenderingError as error:
        return f"none: {error}"


def _bundles() -> list[str]:
    from punnet.bundle import list_bundles

    try:
        return [f"{manifest.name} {manifest.version}" for manifest in list_bundles()]
    except BundleError as error:
        return [f"damaged: {error}"]
