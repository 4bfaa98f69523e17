"""Contact forces: what the tool touches, and how hard each berry is pressed."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.sim.layers import STRUCTURE

__all__ = ["BRUISING_FORCE", "ContactMonitor"]

BRUISING_FORCE = 10.0
"""Newtons of total contact force on one berry over which it counts as damaged.

Ripe strawberries of 20–30 g show bruises from quasi-static loads of the order of 5–15 N on a flat plate; the middle of
that range is used. It is a setting of the simulator, not a measurement of ours.
"""


class ContactMonitor:
    """Keeps, over the steps since :meth:`reset`, the peak force on each berry and what the tool touched.

    Needs elliptic friction cones, where a contact's first constraint force is its normal force.

    Parameters
    ----------
    model
        The compiled world.
    first_link
        Body that the arm's first joint turns: what hangs on it is the tool.
    berry_of_geom
        (ngeom,) index of the berry a geometry belongs to, −1 for none.
    """

    def __init__(
        self, model: mujoco.MjModel, first_link: str, berry_of_geom: NDArray[np.int64], berries: int
    ) -> None:
        self._berry_of_geom = berry_of_geom
        link = model.body(first_link).id
        self._is_tool = np.array([self._under(model, body, link) for body in model.geom_bodyid])
        self._is_structure = (model.geom_contype == STRUCTURE[0]) & (model.geom_conaffinity == STRUCTURE[1])
        berry, by_tool = berry_of_geom >= 0, np.logical_and.outer(self._is_tool, self._is_structure)
        self._counts = np.logical_or.outer(berry, berry) | by_tool | by_tool.T
        self._berries = berries
        self.peak_on_berry = np.zeros(berries)
        self.tool_peak_on_berry = np.zeros(berries)
        self._recent_tool_peak_on_berry = np.zeros(berries)
        self._recent_tool_peak = 0.0
        self._recent_structure_peak = 0.0

    @staticmethod
    def _under(model: mujoco.MjModel, body: int, link: int) -> bool:
        while body > 0:
            if body == link:
                return True
            body = int(model.body_parentid[body])
        return False

    def reset_recent(self) -> None:
        """Forget the recent peaks (those since the last motion began); the lifetime peaks stay."""
        self._recent_tool_peak_on_berry[:] = 0.0
        self._recent_tool_peak = self._recent_structure_peak = 0.0

    @property
    def recent_tool_peaks(self) -> NDArray[np.float64]:
        """(N,) peak force of the tool on each berry since :meth:`reset_recent`, newtons."""
        return self._recent_tool_peak_on_berry.copy()

    @property
    def recent_tool_peak(self) -> float:
        """Peak force of the tool on any one berry since :meth:`reset_recent`, newtons."""
        return self._recent_tool_peak

    @property
    def recent_structure_peak(self) -> float:
        """Peak force between the arm and structure since :meth:`reset_recent`, newtons."""
        return self._recent_structure_peak

    def update(self, data: mujoco.MjData) -> None:
        """Take in the contacts of the step just made."""
        if data.ncon == 0 or data.nefc == 0:
            return
        contact = data.contact
        geoms = contact.geom
        counted = self._counts[geoms[:, 0], geoms[:, 1]].nonzero()[0]
        if not len(counted):  # as in most steps: the arm's own parts, leaves and stems lie against each other
            return
        geoms, address = geoms[counted], contact.efc_address[counted]
        berry, tool = self._berry_of_geom[geoms], self._is_tool[geoms]
        force = np.where(address >= 0, data.efc_force[address], 0.0)
        on_berries = np.zeros(self._berries)
        by_tool = np.zeros(self._berries)
        for one, other in ((0, 1), (1, 0)):
            struck = np.flatnonzero(berry[:, one] >= 0)
            np.add.at(on_berries, berry[struck, one], force[struck])
            np.add.at(by_tool, berry[struck, one], force[struck] * tool[struck, other])
        np.maximum(self.peak_on_berry, on_berries, out=self.peak_on_berry)
        np.maximum(self.tool_peak_on_berry, by_tool, out=self.tool_peak_on_berry)
        np.maximum(self._recent_tool_peak_on_berry, by_tool, out=self._recent_tool_peak_on_berry)
        self._recent_tool_peak = max(self._recent_tool_peak, float(by_tool.max(initial=0.0)))
        hard = force[(tool & self._is_structure[geoms][:, ::-1]).any(axis=1)]
        self._recent_structure_peak = max(self._recent_structure_peak, float(hard.max(initial=0.0)))
