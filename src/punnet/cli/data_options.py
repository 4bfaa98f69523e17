"""Options that the commands of ``punnet data`` share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from punnet.errors import ConfigurationError

__all__ = ["ClassMapping", "DataFormat", "DataPath", "class_map_of"]

DataPath = Annotated[
    Path,
    typer.Argument(
        help="A file or folder of labelled images, of any format that is read.", show_default=False
    ),
]
DataFormat = Annotated[
    str | None,
    typer.Option("--format", help="The format; without it, what lies at the path tells.", show_default=False),
]
ClassMapping = Annotated[
    list[str] | None,
    typer.Option(
        "--class-map",
        metavar="NAME=CLASS",
        help="What a class of the file means: pluckable, unpluckable or ignore; may be given several times.",
        show_default=False,
    ),
]


def class_map_of(given: list[str] | None) -> dict[str, str] | None:
    """``--class-map`` as a dictionary; None if it was not given.

    Raises
    ------
    ConfigurationError
        If one has no ``=``.
    """
    if not given:
        return None
    pairs = [entry.rpartition("=") for entry in given]
    for entry, (name, _, _) in zip(given, pairs, strict=True):
        if not name:
            raise ConfigurationError(
                f"--class-map {entry}: NAME=CLASS is needed, for instance ripe=pluckable"
            )
    return {name.strip(): target.strip() for name, _, target in pairs}
