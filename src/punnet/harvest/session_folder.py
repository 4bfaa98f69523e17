"""Run a scenario and leave everything worth looking at in a folder."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from punnet.harvest.attempts import Attempt, HarvestRun
from punnet.harvest.loop import CUTTING
from punnet.harvest.records import HarvestReport
from punnet.harvest.report import write_report
from punnet.harvest.scenario import Scenario, Session
from punnet.harvest.telling import annotated_first_view, tell
from punnet.outputs import OutputFolder
from punnet.planning.plot import plot_distribution
from punnet.sim.film import Recorder, render_close_ups, render_film

__all__ = ["Announcer", "harvest_into"]


@dataclass
class Announcer:
    """Where a run says what it does: ``line`` for each step, ``film`` for frames drawn and frames in all."""

    line: Callable[[str], None] = lambda text: None
    film: Callable[[int, int], None] = lambda done, total: None


def harvest_into(
    output: OutputFolder, scenario: Scenario, announcer: Announcer | None = None
) -> HarvestReport:
    """Harvest a simulated plant and write the folder.

    It holds ``first_view.png`` (what was found), ``frame/`` (the first RGB-D frame), ``reach.png`` (the trajectory
    distribution of the first plan), ``harvest.mp4``, ``harvest.json`` and ``report.html``, which holds all of it.
    Interrupted, it still writes all but the film.

    Parameters
    ----------
    output
        An open output folder.

    Raises
    ------
    KeyboardInterrupt
        After the partial results were written, if the run was interrupted.
    """
    announcer = announcer or Announcer()
    recorder = Recorder()

    def listen(text: str, attempt: Attempt | None) -> None:
        recorder.caption = text if attempt is None else f"berry {attempt.number}: {text}"
        announcer.line(recorder.caption)

    with Session(scenario, listen) as session:
        session.robot.observers.append(recorder)
        run = session.run()
        _write_pictures(output, run)
        report = tell(session, run, _close_ups(session, run, recorder))
        _write(output, report)
        if run.interrupted:
            raise KeyboardInterrupt
        video = output.path / "harvest.mp4"
        render_film(recorder, session.world, video, progress=announcer.film)
    report = replace(report, video=video.read_bytes())
    _write(output, report)
    return report


def _close_ups(session: Session, run: HarvestRun, recorder: Recorder) -> dict[int, NDArray[np.uint8]]:
    """Pictures of the cut, by the number of the attempt."""
    moments = [(f"berry {attempt.number}: {CUTTING}", attempt.picking_point) for attempt in run.attempts]
    pictures = render_close_ups(recorder, session.world, moments)
    return {
        attempt.number: picture
        for attempt, picture in zip(run.attempts, pictures, strict=True)
        if picture is not None
    }


def _write_pictures(output: OutputFolder, run: HarvestRun) -> None:
    view = annotated_first_view(run)
    if view is not None and run.first_frame is not None:
        (output.path / "first_view.png").write_bytes(view)
        run.first_frame.save(output.path / "frame")
    planned = next((attempt for attempt in run.attempts if attempt.distribution is not None), None)
    if planned is not None and planned.distribution is not None:
        plot_distribution(planned.distribution, output.path / "reach.png", title="Reach to the first berry")


def _write(output: OutputFolder, report: HarvestReport) -> None:
    text = json.dumps(report.to_json(), indent=2, ensure_ascii=False, allow_nan=False)
    (output.path / "harvest.json").write_text(text + "\n", encoding="utf-8")
    write_report(output.path / "report.html", report)
    output.finished()
