import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from punnet.errors import ShapeError
from punnet.planning.capsules import Capsules, segment_distances

POINT = st.tuples(*[st.floats(-0.25, 0.25, width=32)] * 3)


def slow_distance(p1, q1, p2, q2):
    """By SciPy's least squares within bounds: the shares of both segments at which their points are nearest."""
    p1, q1, p2, q2 = (np.asarray(v, dtype=np.float64) for v in (p1, q1, p2, q2))
    directions = np.column_stack((q1 - p1, p2 - q2))
    found = lsq_linear(directions, p2 - p1, bounds=(0.0, 1.0), method="bvls", tol=1e-14)
    return np.linalg.norm(directions @ found.x - (p2 - p1))


@settings(deadline=None, max_examples=60)
@given(POINT, POINT, POINT, POINT)
@example((0.0, -0.25, 0.0), (0.0, -0.125, 0.109375), (0.0, -0.1875, 0.0), (0.0, 0.125, 0.125))
def test_distance_is_the_least_one(p1, q1, p2, q2):
    ours = segment_distances([p1], [q1], [p2], [q2])[0, 0]
    assert ours == pytest.approx(slow_distance(p1, q1, p2, q2), abs=4e-4)


@settings(deadline=None, max_examples=40)
@given(POINT, POINT, POINT, POINT)
def test_it_does_not_matter_which_segment_is_named_first(p1, q1, p2, q2):
    one = segment_distances([p1], [q1], [p2], [q2])[0, 0]
    assert segment_distances([p2], [q2], [p1], [q1])[0, 0] == pytest.approx(one, abs=4e-4)
    assert segment_distances([q1], [p1], [p2], [q2])[0, 0] == pytest.approx(one, abs=4e-4)


def test_known_distances():
    line = ([[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.1]])
    others = np.array([[0.03, 0.0, 0.05], [0.0, 0.04, 0.2], [0.0, 0.0, 0.05]])
    distances = segment_distances(*line, others, others)  # points
    np.testing.assert_allclose(distances[0], [0.03, np.hypot(0.04, 0.1), 0.0], atol=2e-4)
    beside = segment_distances(*line, [[0.02, 0.0, 0.0]], [[0.02, 0.0, 0.3]])  # parallel
    assert beside[0, 0] == pytest.approx(0.02, abs=2e-4)
    assert segment_distances(*line, np.zeros((0, 3)), np.zeros((0, 3))).shape == (1, 0)


def test_points_lie_on_the_segment_ends_included():
    capsule = Capsules([[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.1]], [0.01])
    np.testing.assert_allclose(capsule.points(3)[0, :, 2], [0.0, 0.05, 0.1])
    assert len(capsule) == 1


def test_shapes_are_named():
    with pytest.raises(ShapeError, match=r"\(N, 3\)"):
        Capsules(np.zeros((2, 3)), np.zeros((1, 3)), np.zeros(2))
    with pytest.raises(ShapeError, match="finite"):
        Capsules([[0.0, 0.0, np.nan]], [[0.0, 0.0, 0.0]], [0.01])
