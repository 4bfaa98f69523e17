"""How unsure a predicted end is: so that regions hold the share of demonstrations that they say, on groups left out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from punnet.movement.distribution import Space
from punnet.planning.reaches import DEGREES, Reaches
from punnet.robot import Panda
from punnet.train.planner.regression import LeftOut

__all__ = ["doubt_of_ends", "places"]

Array = NDArray[np.float64]
WIDENINGS = np.geomspace(0.1, 10.0, 81)
TOLERANCES = {0.5: 0.07, 0.9: 0.05}
"""Shares of demonstrations that regions are to hold, and how far off each may be."""
RIDGE = 1e-9


def doubt_of_ends(space: Space, reaches: Reaches, unseen: LeftOut, within: Array) -> Array:
    """V (7, 7) of an end of leverage 0: scatter of the ends of groups left out, widened so that regions hold their shares.

    A row's covariance is (1 + its leverage) · V, here as later on unseen photographs.

    Parameters
    ----------
    space
        Of the ends, joint or task.
    reaches
        What was learnt from.
    unseen
        How far off the (M) targets' ends are in groups left out.
    within
        (7, 7) how ends of repeats to one target differ.
    """
    growth = 1.0 + unseen.leverage
    scaled = unseen.residuals / np.sqrt(growth)[:, None]
    scatter = scaled.T @ scaled / len(scaled)
    place = places(space, reaches)
    demonstrated = _offs_of_demonstrations(reaches, np.einsum("mij,mj->mi", place, unseen.residuals))

    def missed(widening: float) -> float:
        region = growth[:, None, None] * (
            place @ (widening * scatter + within) @ place.transpose(0, 2, 1)
        ) + RIDGE * np.eye(3)
        distance = np.einsum(
            "pk,pkl,pl->p", demonstrated, np.linalg.inv(region)[reaches.targets], demonstrated
        )
        return max(
            abs(float((distance < chi2.ppf(share, 3)).mean()) - share) / tolerance
            for share, tolerance in TOLERANCES.items()
        )

    return np.asarray(min(WIDENINGS, key=missed) * scatter + within)


def places(space: Space, reaches: Reaches) -> Array:
    """(M, 3, 7) how the flange's position moves with the end."""
    if space == "task":
        return np.broadcast_to(np.eye(3, DEGREES), (len(reaches.target_ids), 3, DEGREES))
    ends = reaches.joint.mean @ reaches.basis.phi([1.0])[0]
    return np.asarray(Panda().jacobian(ends)[:, :3])


def _offs_of_demonstrations(reaches: Reaches, off: Array) -> Array:
    """(P, 3) how far each demonstration ended from what is told of its target, of which the mean is ``off`` (M, 3)."""
    mean = (reaches.pose.mean @ reaches.basis.phi([1.0])[0])[:, :3]
    return np.asarray((off - mean)[reaches.targets] + reaches.ends[:, :3])
