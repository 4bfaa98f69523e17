"""Errors: each says what was wrong, where, and what to do.

Everything that Punnet raises on purpose is a :class:`PunnetError`; the command line prints its one line and
leaves the traceback to ``--debug``. Constructors that validate raise the subclass that is also a
:class:`ValueError`, so callers that know nothing of Punnet can catch the built-in.
"""

__all__ = [
    "BundleError",
    "ConfigurationError",
    "FileFormatError",
    "KinematicsError",
    "OutputError",
    "OutputExistsError",
    "PlanningError",
    "PunnetError",
    "RenderingError",
    "RobotError",
    "ShapeError",
]


class PunnetError(Exception):
    """Base of every error that Punnet raises on purpose."""


class ShapeError(PunnetError, ValueError):
    """An array has the wrong shape, type or values; the message names it and what was expected."""


class ConfigurationError(PunnetError, ValueError):
    """A setting is out of its range or contradicts another."""


class FileFormatError(PunnetError, ValueError):
    """A file is missing, unreadable or not what it should be; the message names the file."""


class OutputError(PunnetError):
    """Results can't be written where they should go; the message names the place."""


class OutputExistsError(OutputError):
    """An output would overwrite something that exists; pass ``--force`` (``force=True``) to allow it."""


class BundleError(PunnetError):
    """A model bundle is damaged, of an unknown schema or of the wrong kind."""


class KinematicsError(PunnetError):
    """A pose can't be reached, or a path can't be followed within the joint limits."""


class PlanningError(PunnetError):
    """No plan exists for this target; the message gives the reason."""


class RobotError(PunnetError):
    """The robot could not do what was asked (stall, limit, lost camera)."""


class RenderingError(PunnetError):
    """No OpenGL back end could be started for headless rendering; the message says what to install."""
