import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ShapeError
from punnet.planning.approach import comfortable_angles
from punnet.planning.clearance import AMPLE, Obstacles, approach_directions, clearance

POINT = np.array([0.75, -0.06, 0.70])
STRAIGHT = np.array([0.0])


def berries(*offsets, radius=0.015, length=0.04):
    points = POINT + np.array(offsets, dtype=float).reshape(-1, 3)
    return Obstacles(points, np.full(len(points), radius), np.full(len(points), length))


def test_alone_there_is_all_the_room_in_the_world():
    assert clearance(POINT, berries(), STRAIGHT)[0] == np.inf
    _, gap = approach_directions(POINT, berries())
    assert gap == np.inf


def test_a_stem_in_front_leaves_its_distance():
    # 60 mm nearer, 20 mm aside; hangs so low that only its stem crosses the picker's height
    assert clearance(POINT, berries((-0.06, 0.02, -0.06)), STRAIGHT)[0] == pytest.approx(0.02)


def test_a_fruit_in_front_leaves_the_distance_of_its_surface():
    assert clearance(POINT, berries((-0.06, 0.03, 0.03)), STRAIGHT)[0] == pytest.approx(0.015)


@pytest.mark.parametrize(
    "elsewhere", [(0.10, 0.0, 0.0), (-0.30, 0.0, 0.0), (-0.06, 0.0, 0.15), (-0.06, 0.0, -0.20)]
)
def test_behind_beyond_above_and_below_nothing_is_in_the_way(elsewhere):
    assert clearance(POINT, berries(elsewhere), STRAIGHT)[0] == np.inf


def test_the_tool_comes_in_from_the_free_side():
    comfortable = float(comfortable_angles(POINT)[0])
    forward = np.array([np.cos(comfortable), np.sin(comfortable), 0.0])
    left = np.array([-forward[1], forward[0], 0.0])
    blocked_left = berries(*(-0.05 * forward + 0.012 * left - (0, 0, 0.03),))
    directions, gap = approach_directions(POINT, blocked_left)
    # Coming from the right means pointing to the left: a larger yaw.
    assert np.arctan2(directions[0, 1], directions[0, 0]) > comfortable
    assert gap > 0.012


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(*[st.floats(-0.15, 0.15)] * 3), max_size=6))
def test_directions_are_units_and_the_first_is_best(offsets):
    around = berries(*offsets)
    directions, gap = approach_directions(POINT, around)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1.0)
    gaps = clearance(POINT, around, np.arctan2(directions[:, 1], directions[:, 0]))
    assert gaps[0] == pytest.approx(gap)
    assert min(gap, AMPLE) >= np.minimum(gaps, AMPLE).max() - 0.012


def test_shapes_are_named():
    with pytest.raises(ShapeError, match=r"\(N, 3\)"):
        Obstacles(np.zeros((2, 2)), np.zeros(2), np.zeros(2))
