"""Which berry next: what a try is likely to cost in seconds, and simpler orders to compare it with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.geometry import invert_transform, make_transform
from punnet.planning.approach import approach_rotation, comfortable_angles
from punnet.planning.clearance import approach_directions, gaps, obstacles_among
from punnet.robot import HOME, Panda
from punnet.robot.projection import projected
from punnet.scene import Frame, Strawberries

__all__ = [
    "DEFAULT_ORDER",
    "ORDERS",
    "Order",
    "cheapest_first",
    "expected_seconds",
    "front_first",
    "hidden_shares",
    "left_to_right",
    "nearest_first",
    "order_of",
]

Order = Callable[[Frame, Strawberries], NDArray[np.int64]]
"""Rows of the pluckable berries with a known picking point, in the order to pick them."""

_ROW_DEPTH = 0.03
"""Berries whose distance from the robot differs by less than this (metres) count as hanging equally far in front."""
_FREE = 0.022
"""Metres of clearance with which the picker passes without touching."""
_FAILURE = 12.0
"""Seconds that a failed try takes."""
_IF_BLOCKED, _IF_HIDDEN, _IF_STRAINED = 0.6, 0.4, 0.3
"""Share of tries that fail where there is no room at all, where nothing shows, and where the arm can hardly get to."""
_PER_METRE_BEHIND = 30.0
"""Seconds: what hangs in front may free what hangs behind it."""
_JOINT_SPEED = 1.0  # rad/s that a careful reach makes
_LOW_MARGIN, _LOW_MANIPULABILITY = 0.15, 0.012


def cheapest_first(frame: Frame, berries: Strawberries) -> NDArray[np.int64]:
    """Rows in the order of what a try is expected to cost: :func:`expected_seconds`."""
    rows = _candidates(berries)
    return np.asarray(rows[np.argsort(expected_seconds(frame, berries, rows), kind="stable")], dtype=np.int64)


def front_first(frame: Frame, berries: Strawberries) -> NDArray[np.int64]:
    """Those that have the fewest to be picked in their way first, of these those without anything in it, the front, the lowest.

    The more is picked in front, the less there is to touch behind.
    """
    points, rows = berries.picking_points, _candidates(berries)
    blocked = np.array([_room(frame, berries, int(row)) < _FREE for row in rows], dtype=np.bool_)
    waiting_for = np.array([_in_the_way(frame, berries, int(row), rows) for row in rows], dtype=np.int64)
    front = np.floor(points[rows, 0] / _ROW_DEPTH)
    return np.asarray(rows[np.lexsort((points[rows, 2], front, blocked, waiting_for))], dtype=np.int64)


def left_to_right(frame: Frame, berries: Strawberries) -> NDArray[np.int64]:
    """As one reads."""
    rows = _candidates(berries)
    return np.asarray(rows[np.argsort(berries.boxes[rows, 0], kind="stable")], dtype=np.int64)


def nearest_first(frame: Frame, berries: Strawberries) -> NDArray[np.int64]:
    """By distance from the camera; by the size of the box where there is no pose of it."""
    rows = _candidates(berries)
    if frame.T_base_camera is None:
        boxes = berries.boxes[rows]
        return np.asarray(rows[np.argsort(-np.prod(boxes[:, 2:] - boxes[:, :2], axis=1), kind="stable")])
    distance = np.linalg.norm(berries.picking_points[rows] - frame.T_base_camera[:3, 3], axis=1)
    return np.asarray(rows[np.argsort(distance, kind="stable")], dtype=np.int64)


ORDERS: dict[str, Order] = {
    "cheapest": cheapest_first,
    "front-first": front_first,
    "nearest-first": nearest_first,
    "left-to-right": left_to_right,
}
DEFAULT_ORDER = "front-first"


def order_of(name: str) -> Order:
    """The order of that name.

    Raises
    ------
    ConfigurationError
        If there is none.
    """
    if name not in ORDERS:
        raise ConfigurationError(f"order: there is no '{name}'; there are {', '.join(ORDERS)}")
    return ORDERS[name]


def expected_seconds(frame: Frame, berries: Strawberries, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """What each of ``rows`` (R,) is expected to cost: the way there, and a failed try times how likely it is.

    Likelier where neighbours leave the picker no room, where the berry is hidden, and where the arm is near a limit or a
    singularity. What hangs behind others waits.
    """
    points = berries.picking_points[rows]
    if not len(rows):
        return np.zeros(0)
    room = np.array([_room(frame, berries, int(row)) for row in rows])
    blocked = np.clip(1.0 - room / _FREE, 0.0, 1.0)
    travel, strain = _reach(points)
    likely = _IF_BLOCKED * blocked + _IF_HIDDEN * hidden_shares(berries)[rows] + _IF_STRAINED * strain
    behind = _PER_METRE_BEHIND * (points[:, 0] - points[:, 0].min())
    return np.asarray(travel + _FAILURE * np.minimum(likely, 1.0) + behind)


def hidden_shares(berries: Strawberries) -> NDArray[np.float64]:
    """(N,) share of each berry's box that the boxes of nearer berries cover; of a nearer one alone if several do."""
    boxes = berries.boxes
    low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    common = np.prod(np.clip(high - low, 0.0, None), axis=2)
    area = np.maximum(np.prod(boxes[:, 2:] - boxes[:, :2], axis=1), 1e-9)
    depth = berries.picking_points[:, 0]
    nearer = depth[None, :] < depth[:, None] - 0.005
    return np.asarray((np.where(nearer, common, 0.0) / area[:, None]).max(axis=1, initial=0.0))


def _candidates(berries: Strawberries) -> NDArray[np.int64]:
    located = np.isfinite(berries.picking_points).all(axis=1)
    return np.asarray(np.flatnonzero(berries.pluckable & located), dtype=np.int64)


def _room(frame: Frame, berries: Strawberries, row: int) -> float:
    """Clearance in metres of the best approach."""
    point = berries.picking_points[row]
    return approach_directions(point, obstacles_among(frame, berries, row))[1]


def _in_the_way(frame: Frame, berries: Strawberries, row: int, rows: NDArray[np.int64]) -> int:
    """How many of ``rows``, which are picked sooner or later, the picker would touch on the best approach to one."""
    point, around = berries.picking_points[row], obstacles_among(frame, berries, row)
    direction = approach_directions(point, around)[0][0]
    yaw = np.arctan2(direction[1:2], direction[:1])
    located = np.flatnonzero(np.isfinite(berries.picking_points).all(axis=1))
    others = located[located != row]
    touched = others[gaps(point, around, yaw)[0] < _FREE]
    return int(np.isin(touched, rows).sum())


def _reach(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Seconds from home to grip points (R, 3) and how strained the arm is there, 0 … 1 (out of reach)."""
    arm = Panda()
    poses = make_transform(approach_rotation(*comfortable_angles(points)), points) @ invert_transform(
        arm.T_flange_tool
    )
    joints = projected(arm, np.tile(HOME, (len(points), 1)), poses)
    reached = arm.within_limits(joints)
    joints = np.where(reached[:, None], joints, HOME)
    travel = np.abs(joints - HOME).max(axis=1) / _JOINT_SPEED
    margin = np.maximum(arm.limit_margin(joints), 1e-3)
    dexterity = np.maximum(arm.manipulability(joints), 1e-4)
    strain = np.minimum((_LOW_MARGIN / margin) ** 2 + (_LOW_MANIPULABILITY / dexterity) ** 2, 1.0)
    return travel, np.where(reached, strain, 1.0)
