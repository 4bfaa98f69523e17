"""The command ``punnet``: one thin file a command group; the rooms do the work."""

from punnet.cli.app import main

__all__ = ["main"]
