"""The commands put together, and what becomes of errors: one line on stderr and an exit code.

=====  ========================================================
code   meaning
=====  ========================================================
0      done
1      an error of Punnet's: bad input, no result, or a part of the input was left out
2      the command line is wrong
70     a fault in Punnet
130    interrupted (Ctrl-C); what was finished is kept
=====  ========================================================
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer

from punnet import __version__
from punnet.cli import (
    benchmark,
    data,
    demo,
    demos,
    detect,
    evaluate,
    info,
    models,
    plan,
    reproduce,
    train,
    weigh,
)
from punnet.errors import PunnetError
from punnet.outputs import Interrupted

__all__ = ["app", "main"]

DEBUG = "--debug"

app = typer.Typer(
    name="punnet",
    help="From a camera frame of a strawberry plant to a picked berry in a punnet.",
    epilog="A first try: punnet demo --out first-harvest",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode="rich",
)
for _group in (demo, detect, weigh, plan, data, evaluate, reproduce, benchmark, demos, train, models, info):
    _group.register(app)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"punnet {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and stop."),
    ] = False,
    debug: Annotated[
        bool, typer.Option(DEBUG, help="Show the traceback of an error; may stand anywhere.")
    ] = False,
) -> None:
    del version, debug  # the one has its callback; main() takes the other out before Typer looks


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    debug = DEBUG in given
    given = [argument for argument in given if argument != DEBUG]
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    sys.exit(_guarded(lambda: app(given, prog_name="punnet"), debug))


def _guarded(run: Callable[[], Any], debug: bool) -> int:
    """Exit code of ``run``, its errors told on stderr."""
    try:
        run()
    except SystemExit as error:
        # Typer turns Ctrl-C into an exit of its own.
        interrupt = _cause_of_kind(error, KeyboardInterrupt)
        if interrupt is not None:
            return _interrupted(interrupt)
        return error.code if isinstance(error.code, int) else 0 if error.code is None else 1
    except KeyboardInterrupt as error:
        return _interrupted(error)
    except PunnetError as error:
        return _told(error, f"punnet: error: {_one_line(error)}", 1, debug)
    except Exception as error:
        return _told(error, f"punnet: fault: {type(error).__name__}: {_one_line(error)}", 70, debug)
    return 0


def _cause_of_kind(error: BaseException | None, kind: type[BaseException]) -> BaseException | None:
    while error is not None and not isinstance(error, kind):
        error = error.__cause__ or error.__context__
    return error


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _told(error: Exception, line: str, code: int, debug: bool) -> int:
    if debug:
        import traceback

        traceback.print_exception(error)
    print(line, file=sys.stderr)
    if not debug:
        for note in getattr(error, "__notes__", ()):
            print(f"punnet: {note}", file=sys.stderr)
        if code == 70:
            print(
                "punnet: run again with --debug; attach that and `punnet info` to a report", file=sys.stderr
            )
    return code


def _interrupted(error: BaseException) -> int:
    kept = error.kept if isinstance(error, Interrupted) else None
    what = f"kept what was finished in {kept}" if kept else "nothing was finished, nothing is kept"
    print(f"\npunnet: interrupted; {what}", file=sys.stderr)
    return 130
