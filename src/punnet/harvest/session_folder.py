"""Run a scenario and leave everything worth looking at in a folder."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.harvest.attempts import Attempt, HarvestRun
from punnet.harvest.durable import told_disk_errors, write_durably
from punnet.harvest.folder import HarvestFolder
from punnet.harvest.journal import SessionJournal
from punnet.harvest.loop import summary
from punnet.harvest.picking import CUTTING, GRIPPING
from punnet.harvest.picks_table import write_picks
from punnet.harvest.progress import Progress
from punnet.harvest.records import HarvestReport
from punnet.harvest.report import write_report
from punnet.harvest.scenario import Scenario, Session
from punnet.harvest.telling import annotated_first_view, tell
from punnet.planning.plot import plot_distribution
from punnet.sim.film import Recorder, render_close_ups, render_film
from punnet.sim.punnets import PUNNET_PLACES

__all__ = ["Announcer", "harvest_into", "journaled_session"]


@dataclass
class Announcer:
    """Where a run says what it does: ``line`` and ``progress`` for each step, ``film`` for frames drawn and frames in all."""

    line: Callable[[str], None] = lambda text: None
    film: Callable[[int, int], None] = lambda done, total: None
    progress: Callable[[Progress], None] = lambda progress: None


def harvest_into(
    output: HarvestFolder,
    scenario: Scenario,
    announcer: Announcer | None = None,
    options: Mapping[str, Any] | None = None,
    pick: int | None = None,
) -> HarvestReport:
    """Harvest a simulated plant and write the folder.

    While it runs it holds ``harvest.jsonl`` (the log: a line an event, on the disk before the next) and ``picks/``, a
    folder for each attempt with the frame, berries and planned reach it began with. At the end it also holds
    ``first_view.png`` (what was found), ``frame/`` (the first RGB-D frame), ``reach.png`` (the trajectory
    distribution of the first plan), ``harvest.mp4``, ``harvest.json``, ``picks.parquet`` (if pyarrow is there) and
    ``report.html``, which holds all of it. Interrupted, it still writes all but the film.

    Parameters
    ----------
    output
        An open folder; if it was opened to resume, the harvest goes on from the last attempt that ended.
    options
        What the command was given, for the log: it makes the same scenario of them to resume.
    pick
        Number of the attempt that report and film are to be of; the harvest ends with it. None: all of them.

    Raises
    ------
    ConfigurationError
        If the harvest has no attempt of that number.
    KeyboardInterrupt
        After the partial results were written, if the run was interrupted.
    OutputError
        If the disk does not take what is written; the arm is home by then.
    """
    announcer = announcer or Announcer()
    if pick is not None:
        scenario = replace(scenario, harvest=replace(scenario.harvest, most_attempts=pick))
    with (
        told_disk_errors(output.path),
        journaled_session(output, scenario, options or {}, announcer) as (session, journal, recorder),
    ):
        run = session.run()
        journal.note(
            "ended",
            interrupted=run.interrupted,
            stopped=run.stopped,
            home=run.home,
            punnets_g=list(run.punnet_weights),
        )
        if pick is not None and not run.interrupted:
            _leave_only(pick, run, recorder)
        _write_pictures(output, run)
        report = tell(session, run, _close_ups(session, run, recorder))
        report = replace(report, created=journal.created, resumed=tuple(journal.history.resumed), only=pick)
        _write(output, report)
        if run.interrupted:
            raise KeyboardInterrupt
        video = output.path / "harvest.mp4"
        render_film(recorder, session.world, video, progress=announcer.film)
        report = replace(report, video=video.read_bytes())
        _write(output, report)
    return report


def _leave_only(pick: int, run: HarvestRun, recorder: Recorder) -> None:
    """Drop the other attempts, and what was filmed of them."""
    last = len(run.attempts)
    if last < pick:
        raise ConfigurationError(f"pick {pick}: this harvest has only {last} attempts")
    run.attempts = [attempt for attempt in run.attempts if attempt.number == pick]
    recorder.states = [state for state in recorder.states if state.caption.startswith(f"berry {pick}: ")]


@contextmanager
def journaled_session(
    output: HarvestFolder,
    scenario: Scenario,
    options: Mapping[str, Any],
    announcer: Announcer | None = None,
) -> Iterator[tuple[Session, SessionJournal, Recorder]]:
    """A session that is filmed and writes down each attempt in ``output``; brought to where the log there ends.

    ``announcer`` is told of each step.
    """
    recorder, announcer = Recorder(), announcer or Announcer()

    def listen(text: str, attempt: Attempt | None) -> None:
        recorder.caption = text if attempt is None else f"berry {attempt.number}: {text}"
        announcer.line(recorder.caption)
        run = session.harvester.run_so_far
        announcer.progress(Progress.of(run, len(PUNNET_PLACES), session.robot.time))

    with Session(scenario, listen) as session:
        journal = SessionJournal(output, session, recorder, options)
        session.resume(journal.history)
        session.harvester.journal = journal
        session.robot.observers.append(recorder)
        yield session, journal, recorder


def _close_ups(
    session: Session, run: HarvestRun, recorder: Recorder
) -> dict[int, dict[str, NDArray[np.uint8]]]:
    """Pictures of each attempt's moments, by its number and their captions."""
    wanted = [
        (attempt, caption, f"berry {attempt.number}: {said}")
        for attempt in run.attempts
        for caption, said in (
            ("at the grip", GRIPPING),
            ("at the cut", CUTTING),
            ("afterwards", summary(attempt)),
        )
    ]
    moments = [(said, attempt.picking_point) for attempt, _, said in wanted]
    pictures: dict[int, dict[str, NDArray[np.uint8]]] = {}
    for (attempt, caption, _), picture in zip(
        wanted, render_close_ups(recorder, session.world, moments), strict=True
    ):
        if picture is not None:
            pictures.setdefault(attempt.number, {})[caption] = picture
    return pictures


def _write_pictures(output: HarvestFolder, run: HarvestRun) -> None:
    view = annotated_first_view(run)
    if view is not None and run.first_frame is not None:
        write_durably(output.path / "first_view.png", view)
        run.first_frame.save(output.path / "frame", force=True)
    planned = next((attempt for attempt in run.attempts if attempt.distribution is not None), None)
    if planned is not None and planned.distribution is not None:
        plot_distribution(planned.distribution, output.path / "reach.png", title="Reach to the first berry")


def _write(output: HarvestFolder, report: HarvestReport) -> None:
    text = json.dumps(report.to_json(), indent=2, ensure_ascii=False, allow_nan=False)
    write_durably(output.path / "harvest.json", text.encode() + b"\n")
    write_report(output.path / "report.html", report)
    write_picks(output.path / "picks.parquet", report.picks)
    output.keep()
