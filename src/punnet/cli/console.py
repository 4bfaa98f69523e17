"""What commands print: results on stdout, everything else on stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from rich.table import Table

__all__ = [
    "busy",
    "counted",
    "counted_progress",
    "note",
    "print_json",
    "print_table",
    "progress_bar",
    "say",
    "track",
    "whisper",
]

Item = TypeVar("Item")


def say(line: str = "") -> None:
    """Print a line of the result on stdout."""
    print(line, flush=True)


def note(line: str) -> None:
    """Print a remark that is not part of the result, on stderr."""
    print(f"punnet: {line}", file=sys.stderr, flush=True)


def counted(number: int, thing: str) -> str:
    """``1 error``, ``2 errors``."""
    return f"{number} {thing}{'' if number == 1 else 's'}"


def print_json(data: Any) -> None:
    """Print one JSON document on stdout."""
    print(json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False))


def print_table(title: str, columns: Sequence[str], rows: Iterable[Iterable[str]]) -> None:
    """Print a table on stdout; columns whose heading ends in ``>`` are set to the right."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table: Table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left", show_header=any(columns))
    for column in columns:
        table.add_column(column.rstrip(">"), justify="right" if column.endswith(">") else "left")
    for row in rows:
        table.add_row(*row)
    # Piped into a file, a table must not be cut at 80 characters.
    Console(width=None if sys.stdout.isatty() else 160, markup=False).print(table)


def track(items: Iterable[Item], total: int, what: str) -> Iterator[Item]:
    """Go through ``items`` with a progress bar on stderr; silent where stderr is no terminal."""
    if not sys.stderr.isatty():
        yield from items
        return
    from rich.console import Console
    from rich.progress import track as rich_track

    yield from rich_track(items, description=what, total=total, console=Console(stderr=True), transient=True)


def whisper(line: str) -> None:
    """Print a line of progress on stderr."""
    print(f"  {line}", file=sys.stderr, flush=True)


@contextmanager
def progress_bar(what: str, total: int) -> Iterator[Callable[[], None]]:
    """A progress bar on stderr; call what it gives once an item. Plain lines where stderr is no terminal."""
    with _bar(what) as show:
        done = 0

        def advance() -> None:
            nonlocal done
            done += 1
            show(done, total)

        yield advance


@contextmanager
def counted_progress(what: str) -> Iterator[Callable[[int, int], None]]:
    """Like :func:`progress_bar`, told of items done and items in all, which nobody knows before."""
    with _bar(what) as show:
        yield show


@contextmanager
def busy(what: str) -> Iterator[None]:
    """Something that moves on stderr while nobody can say how far it is; silent where stderr is no terminal."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(what):
        yield


def _whispered(what: str) -> Callable[[int, int], None]:
    """Progress as lines: each time another fifty are done, and at the end."""
    told = 0

    def show(done: int, total: int) -> None:
        nonlocal told
        if done == total or done // 50 > told // 50:
            whisper(f"{what}: {done} of {total}")
            told = done

    return show


@contextmanager
def _bar(what: str) -> Iterator[Callable[[int, int], None]]:
    if not sys.stderr.isatty():
        yield _whispered(what)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    progress = Progress(*columns, console=Console(stderr=True), transient=True)
    task = progress.add_task(what, total=None, start=False, visible=False)

    def show(done: int, total: int) -> None:
        if not progress.live.is_started:
            progress.start()
            progress.start_task(task)
        progress.update(task, completed=done, total=total, visible=True)

    try:
        yield show
    finally:
        progress.stop()
