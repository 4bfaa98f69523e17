"""Options that the commands of ``punnet demos`` share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["DemoFormatName", "DemoPath"]

DemoPath = Annotated[
    Path,
    typer.Argument(
        help="A file or folder of demonstrations, of any format that is read.", show_default=False
    ),
]
DemoFormatName = Annotated[
    str | None,
    typer.Option("--format", help="The format; without it, what lies at the path tells.", show_default=False),
]
