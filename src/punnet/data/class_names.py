"""Which of the two classes a class name of somebody else's file means."""

from __future__ import annotations

from collections.abc import Mapping

from punnet.errors import ConfigurationError, FileFormatError
from punnet.scene import CLASSES, PLUCKABLE, UNPLUCKABLE

__all__ = ["IGNORED", "ClassMap", "classify", "same_name"]

ClassMap = Mapping[str, str]
"""Class name in the file → ``pluckable``, ``unpluckable`` or ``ignore``."""
IGNORED = "ignore"
KNOWN = {
    "pluckable": PLUCKABLE,
    "ripe": PLUCKABLE,
    "unpluckable": UNPLUCKABLE,
    "unripe": UNPLUCKABLE,
    "green": UNPLUCKABLE,
    "white": UNPLUCKABLE,
    "overripe": UNPLUCKABLE,
    "rotten": UNPLUCKABLE,
}


def classify(name: str, class_map: ClassMap | None, where: str) -> int | None:
    """Class index of ``name``; None if it is to be ignored. The map goes before the names known here.

    Names are compared without regard to case, spaces, hyphens and underscores.

    Parameters
    ----------
    name
        The class in the file.
    class_map
        What the user says names mean, None for nothing.
    where
        File and annotation, for the message.

    Raises
    ------
    FileFormatError
        If nobody says what the name means.
    ConfigurationError
        If the map leads to something that is no class.
    """
    for given, target in (class_map or {}).items():
        if target not in (*CLASSES, IGNORED):
            raise ConfigurationError(
                f"class map: '{given}' leads to {target!r}; it must lead to {', '.join(CLASSES)} or {IGNORED}"
            )
    wanted = same_name(name)
    mapped = {same_name(given): target for given, target in (class_map or {}).items()}.get(wanted)
    if mapped == IGNORED:
        return None
    if mapped is not None:
        return CLASSES.index(mapped)
    if wanted not in KNOWN:
        raise FileFormatError(
            f"{where}: class '{name}' is not known; say what it means, for instance "
            f"class_map={{'{name}': 'pluckable'}} or --class-map '{name}=pluckable' (or unpluckable, ignore)"
        )
    return KNOWN[wanted]


def same_name(name: str) -> str:
    """``name`` as it is compared: lower case, words joined by underscores."""
    return "_".join(name.lower().replace("-", " ").replace("_", " ").split())
