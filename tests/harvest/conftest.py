"""What several tests of the harvest look at."""

import numpy as np
import pytest

from punnet.harvest.scenario import Scenario, Session
from punnet.sim.world import WorldConfig


@pytest.fixture(scope="session")
def two_berries():
    """One look at a simulated plant, and two ripe berries in it, the one that hangs in front first."""
    with Session(Scenario(6, "oracle", WorldConfig(arm_visuals=False))) as session:
        frame = session.robot.look()
        berries = session.harvester._parts.eyes._detector.detect(frame)
        rows = np.flatnonzero(berries.pluckable)
        return frame, berries[rows[np.argsort(berries.picking_points[rows, 0])[[0, -1]]]]
