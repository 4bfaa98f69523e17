"""A harvest that moves nothing: each motion as a file that a robot's driver can follow."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from punnet.harvest.attempts import HarvestRun, Outcome
from punnet.harvest.loop import Listener
from punnet.harvest.scenario import Scenario, Session
from punnet.robot import DryRunRobot, load_arm

__all__ = ["Rehearsal", "rehearse"]


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """What would have been done.

    ``trajectories`` are names of files in the order of the motions, ``seconds`` what they and the tool would take.
    """

    run: HarvestRun
    trajectories: tuple[str, ...]
    seconds: float

    def to_json(self) -> dict[str, Any]:
        """Plain values: each berry's point, punnet and reason, and the files."""
        berries = [
            {
                "picking_point": attempt.picking_point.tolist(),
                "estimate_g": round(attempt.estimate, 2),
                "punnet": None if attempt.punnet is None else attempt.punnet + 1,
                "reason": None if attempt.outcome is Outcome.PICKED else attempt.reason,
            }
            for attempt in self.run.attempts
        ]
        return {
            "berries": berries,
            "trajectories": list(self.trajectories),
            "seconds": round(self.seconds, 3),
            "stopped": self.run.stopped,
        }


def rehearse(scenario: Scenario, folder: str | Path, listener: Listener | None = None) -> Rehearsal:
    """Go through the harvest of a simulated plant with a robot that only writes files.

    The camera is the simulated one at home, so every look shows the whole plant; each berry is tried once, as if each
    try brought it into its punnet. Every motion passes the guard like any other.

    Parameters
    ----------
    folder
        Where ``0001-trajectory.json`` … and ``actions.jsonl`` go.

    Raises
    ------
    PlanningError
        If the arm can't follow what was demonstrated to the planner.
    OutputExistsError
        If the folder holds trajectories already.
    """
    once = replace(scenario.harvest, attempts=1, side_views=0)
    robots: list[DryRunRobot] = []

    def stand_in(camera: Any) -> DryRunRobot:
        robots.append(DryRunRobot(folder, camera, load_arm(scenario.arm).home))
        return robots[0]

    with Session(replace(scenario, harvest=once), listener, stand_in) as session:
        run = session.run()
    robot = robots[0]
    return Rehearsal(run, tuple(path.name for path in robot.trajectories), robot.time)
