"""What a terminal shows while a harvest runs; plain lines where stderr is no terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from punnet.cli.console import counted_progress, whisper

if TYPE_CHECKING:
    from rich.console import RenderableType

    from punnet.harvest.progress import Progress
    from punnet.harvest.session_folder import Announcer

__all__ = ["dashboard", "harvest_progress"]

_BAR = 20


@contextmanager
def harvest_progress(nominal: float) -> Iterator[Announcer]:
    """Where a harvest says what it does; ``nominal`` are the grams of a full punnet."""
    from punnet.harvest.session_folder import Announcer

    with counted_progress("drawing the film") as film:
        if not sys.stderr.isatty():
            yield Announcer(whisper, film)
            return
        from rich.console import Console
        from rich.live import Live

        last = [""]
        with Live(console=Console(stderr=True), refresh_per_second=4, transient=True) as live:

            def draw(done: int, total: int) -> None:
                live.stop()
                film(done, total)

            def show(progress: Progress) -> None:
                live.update(dashboard(progress, nominal, last[0]))

            def line(text: str) -> None:
                last[0] = text

            yield Announcer(line, draw, show)


def dashboard(progress: Progress, nominal: float, doing: str) -> RenderableType:
    """Berries seen, picked and set aside, grams, punnets, and what is being done."""
    from rich.table import Table
    from rich.text import Text

    table = Table.grid(padding=(0, 2))
    table.add_row("seen", f"{progress.seen} berries, {progress.pluckable} pluckable")
    table.add_row("picked", Text(f"{progress.picked}, {progress.grams:.0f} g", style="green"))
    table.add_row("set aside", f"{progress.not_picked}")
    for number, grams in enumerate(progress.punnets, start=1):
        full = min(_BAR, round(_BAR * grams / nominal))
        table.add_row(f"punnet {number}", f"{'█' * full}{'░' * (_BAR - full)} {grams:.0f} of {nominal:.0f} g")
    table.add_row(f"{progress.seconds:.0f} s", Text(doing, style="dim"))
    return table
