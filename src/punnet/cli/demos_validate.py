"""``punnet demos validate``: what is wrong with demonstrations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from punnet.cli.console import counted, counted_progress, note, print_json, print_table, say
from punnet.cli.demos_options import DemoFormatName, DemoPath
from punnet.cli.options import Json

if TYPE_CHECKING:
    from punnet.data.demos import DemoReport

__all__ = ["validate"]


def validate(
    path: DemoPath,
    data_format: DemoFormatName = None,
    most: Annotated[int, typer.Option("--most", min=0, help="List no more faults than this.")] = 30,
    as_json: Json = False,
) -> None:
    """Find what is wrong: time that goes back, jumps, NaN, limits, covariances that are none, swapped boxes, and more.

    An arm with seven joints is held against the Panda's limits and kinematics. Exit code 1 if there is a fault.
    """
    from punnet.data.demos import validate_demos
    from punnet.robot import PANDA_LIMITS, Panda

    with counted_progress("checking episodes") as progress:
        report = validate_demos(
            path,
            data_format,
            limits=PANDA_LIMITS,
            forward_kinematics=Panda().forward_kinematics,
            progress=progress,
        )
    if as_json:
        print_json(report.to_json())
    else:
        _print(report, most)
    if report.faults:
        raise typer.Exit(1)


def _print(report: DemoReport, most: int) -> None:
    from punnet.data.demos import DEMO_FAULTS

    if not report.faults:
        say(f"{report.path}: no fault in {report.episodes} episodes")
        return
    for fault in report.faults[:most]:
        say(f"{fault.where}: {fault.severity}: {fault.code}: {fault.message}")
    if len(report.faults) > most:
        say(f"… and {len(report.faults) - most} more; --json lists all")
    rows = [(code, str(DEMO_FAULTS[code]), str(count)) for code, count in report.by_code.items()]
    print_table("", ("fault", "severity", "times>"), rows)
    note(
        f"{report.path}: {counted(report.errors, 'error')} and {counted(report.warnings, 'warning')}; "
        f"{counted(report.episodes, 'episode')} read"
    )
