"""From a run and the simulator's truth to the report that a person reads."""

from __future__ import annotations

import datetime
import math
import platform
import tempfile
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet import __version__
from punnet.harvest.attempts import Attempt, HarvestRun, Outcome
from punnet.harvest.judge import TOUCH_FORCE
from punnet.harvest.records import HarvestReport, LeftRecord, PickRecord, PunnetRecord
from punnet.harvest.scenario import Session
from punnet.harvest.strip import close_up, strip
from punnet.planning.plot import plot_distribution
from punnet.scene import CLASSES, PLUCKABLE, Strawberries
from punnet.scene.overlay import draw_overlay

__all__ = ["annotated_first_view", "tell", "why_left"]

_RED = 0.9
"""Ripeness over which a berry is red all over: if it is not to be picked, it is past its time."""


def tell(
    session: Session, run: HarvestRun, close_ups: Mapping[int, Mapping[str, NDArray[np.uint8]]] | None = None
) -> HarvestReport:
    """The report of a finished (or interrupted) run; ``close_ups`` are pictures by attempt number and caption."""
    close_ups = close_ups or {}
    scenario = session.scenario
    return HarvestReport(
        ripe=sum(fate.pluckable for fate in session.fates()),
        picks=[_pick(session, attempt, close_ups.get(attempt.number, {})) for attempt in run.attempts],
        left=_left(run),
        punnets=_punnets(session, run),
        seconds_simulated=run.seconds_simulated,
        seconds_computing=run.seconds_computing,
        settings={
            "seed": scenario.seed,
            "perception": scenario.perception,
            "weights by": session.scale_name,
            "planner": session.planner_name,
            **({} if scenario.arm == "panda" else {"arm": scenario.arm}),
            **({} if scenario.planner_bundle is None else {"planner learnt from": scenario.planner_bundle}),
            "berries on the plant": session.world.berries,
            "speed (share of the arm's limits)": f"{scenario.harvest.speed}, among berries {scenario.harvest.careful_speed}",
        },
        versions={
            "punnet": __version__,
            "python": platform.python_version(),
            **{name: version(name) for name in ("mujoco", "numpy", "opencv-python-headless")},
        },
        created=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        first_view=annotated_first_view(run),
        interrupted=run.interrupted,
        stopped=run.stopped,
    )


def annotated_first_view(run: HarvestRun) -> bytes | None:
    """PNG of the first look with what was found in it; None if there was no look."""
    if run.first_frame is None or run.first_berries is None:
        return None
    return _png(draw_overlay(run.first_frame.rgb, run.first_berries))


def _pick(session: Session, attempt: Attempt, close_ups: Mapping[str, NDArray[np.uint8]]) -> PickRecord:
    picked = attempt.outcome is Outcome.PICKED
    truth = session.truth_of.get(attempt.number)
    known = not math.isnan(attempt.estimate)
    return PickRecord(
        id=attempt.number,
        berry_class=CLASSES[int(attempt.berry.classes[0])],
        outcome=attempt.outcome.value,
        reason=None if picked else f"{attempt.phase}: {attempt.reason}",
        estimate_g=attempt.estimate if known else None,
        interval_g=attempt.interval if known else None,
        weighed_g=None if math.isnan(attempt.weighed) else attempt.weighed,
        true_g=truth if picked else None,
        punnet=None if attempt.punnet is None else attempt.punnet + 1,
        seconds_simulated=attempt.seconds_simulated,
        seconds_computing=attempt.seconds_computing,
        notes=tuple(_notes(attempt)),
        images=strip(attempt, close_ups, session.world.arm),
        plot=_plot(attempt),
    )


def _notes(attempt: Attempt) -> Iterator[str]:
    """What was not as usual."""
    if attempt.second_view:
        yield "seen from a second view"
    moved = 1000 * float(np.linalg.norm(attempt.shift))
    if moved >= 0.5:
        yield f"aimed {moved:.0f} mm beside the plan, by a look on the way"
    if attempt.peak_force > TOUCH_FORCE:
        yield f"pressed a fruit with {attempt.peak_force:.1f} N on the way"
    if attempt.failure is not None:
        yield f"then: {attempt.failure.recovery}"


def _left(run: HarvestRun) -> list[LeftRecord]:
    """What the last look still shows, except what was tried and failed."""
    frame, berries = run.last_frame, run.last_berries
    if frame is None or berries is None:
        return []
    tried = [attempt.picking_point for attempt in run.attempts]
    return [
        LeftRecord(
            int(berries.ids[row]),
            CLASSES[int(berries.classes[row])],
            why_left(berries, row),
            close_up(frame.rgb, berries.boxes[row]),
        )
        for row in range(len(berries))
        if not _was_tried(berries.picking_points[row], tried) or berries.classes[row] != PLUCKABLE
    ]


def _was_tried(point: NDArray[np.float64], tried: list[NDArray[np.float64]]) -> bool:
    return any(np.linalg.norm(point - other) < 0.03 for other in tried)


def why_left(berries: Strawberries, row: int) -> str:
    """Why a berry that nobody tried is on the plant, for a reader."""
    if berries.classes[row] != PLUCKABLE:
        ripeness = berries.ripeness[row]
        if math.isnan(ripeness):
            return "not to be picked"
        return f"{'over-ripe or rotten' if ripeness > _RED else 'not ripe yet'} (ripeness {ripeness:.0%})"
    if np.isnan(berries.picking_points[row]).any():
        return "its place is not known: too few depth readings on it"
    return "the run ended before its turn"


def _punnets(session: Session, run: HarvestRun) -> list[PunnetRecord]:
    records = []
    for punnet, (grams, full) in enumerate(zip(run.punnet_weights, run.punnets_full, strict=True)):
        estimates = [attempt.estimate for attempt in run.picked if attempt.punnet == punnet]
        estimated = sum(estimates)
        records.append(
            PunnetRecord(
                punnet + 1,
                grams,
                session.scenario.harvest.nominal_punnet,
                len(estimates),
                None if math.isnan(estimated) else estimated,
                full,
            )
        )
    return records


def _plot(attempt: Attempt) -> bytes | None:
    if attempt.distribution is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.png"
        plot_distribution(attempt.distribution, path, title=f"Reach {attempt.number}")
        return path.read_bytes()


def _png(rgb: NDArray[np.uint8]) -> bytes:
    return bytes(cv2.imencode(".png", rgb[:, :, ::-1])[1].tobytes())
