"""Command lines that stand in texts: whether they are understood as they are typed."""

from __future__ import annotations

import shlex
from typing import Any

import typer

from punnet.cli.app import app

__all__ = ["require_understood"]


def require_understood(line: str) -> None:
    """Read ``punnet …`` as the command would, and run nothing: wrong names, options and values are errors of Click's."""
    words = shlex.split(line, comments=True)
    if ">" in words:  # that is for the shell
        words = words[: words.index(">")]
    assert words[0] == "punnet"
    command: Any = typer.main.get_command(app)
    name = words.pop(0)
    while hasattr(command, "commands"):
        if not words or words[0].startswith("-"):
            break
        assert words[0] in command.commands, f"{name} has no {words[0]}"
        name = words.pop(0)
        command = command.commands[name]
    command.make_context(name, words, resilient_parsing=hasattr(command, "commands"))
