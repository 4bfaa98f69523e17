"""Punnet: from a camera frame of a strawberry plant to a picked berry in a punnet.

The package is laid out in rooms (see ``docs/architecture.md``); import the room you need, e.g.
``from punnet.scene import Frame, Strawberries``. Importing :mod:`punnet` itself stays light: it loads
neither MuJoCo nor Matplotlib nor PyTorch.
"""

from importlib.metadata import PackageNotFoundError, version

from punnet.errors import PunnetError

try:
    __version__ = version("punnet")
except PackageNotFoundError:  # a source tree that was never installed
    __version__ = "0.0.0"

__all__ = ["PunnetError", "__version__"]
