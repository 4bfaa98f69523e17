import numpy as np
import pytest

from punnet.errors import ConfigurationError, ShapeError
from punnet.robot import HOME, Panda
from punnet.sim.demonstrations import (
    REACH_LIKE,
    THESIS_LIKE,
    WORKSPACE,
    Demonstrations,
    reach_to,
    simulate_demonstrations,
)

ARM = Panda()


@pytest.fixture(scope="module")
def demonstrations() -> Demonstrations:
    return simulate_demonstrations(np.random.default_rng(3), configurations=6, repeats=5)


def test_shapes_and_protocol(demonstrations: Demonstrations) -> None:
    assert demonstrations.joints.shape == (30, 150, 7)
    assert len(demonstrations) == 30
    np.testing.assert_array_equal(demonstrations.configuration, np.repeat(np.arange(6), 5))
    assert (demonstrations.targets >= WORKSPACE[0]).all()
    assert (demonstrations.targets <= WORKSPACE[1]).all()
    assert len(np.unique(demonstrations.targets, axis=0)) == 6


def test_every_reach_goes_from_home_to_its_berry_inside_the_limits(demonstrations: Demonstrations) -> None:
    np.testing.assert_allclose(demonstrations.joints[:, 0], np.tile(HOME, (30, 1)), atol=1e-12)
    tips = ARM.forward_kinematics_tool(demonstrations.joints[:, -1])[:, :3, 3]
    assert np.linalg.norm(tips - demonstrations.targets, axis=1).max() < 1e-5
    assert ARM.within_limits(demonstrations.joints, 0.1).all()


def test_the_last_part_is_a_straight_approach_along_the_tools_axis(demonstrations: Demonstrations) -> None:
    poses = ARM.forward_kinematics_tool(demonstrations.joints[:, 105:])
    offsets = poses[..., :3, 3] - demonstrations.targets[:, None]
    forward = poses[:, -1, None, :3, 2]
    along = (offsets * forward).sum(axis=-1)
    aside = np.linalg.norm(offsets - along[..., None] * forward, axis=-1)
    assert along.min() == pytest.approx(-0.09, abs=0.004)
    assert aside.max() < 2e-4
    assert (np.diff(along, axis=1) > -1e-6).all()
    pitch = np.rad2deg(np.arcsin(poses[:, -1, 2, 2]))
    assert (pitch > -15.5).all()
    assert (pitch < 10.5).all()
    assert (poses[:, -1, 2, 0] > 0.9).all()  # tool x is up


def test_motion_is_smooth(demonstrations: Demonstrations) -> None:
    """The arm changes neither branch nor speed at once."""
    steps = np.diff(demonstrations.joints, axis=1)
    assert np.abs(steps).max() < 0.06
    assert np.abs(np.diff(steps, axis=1)).max() < 0.012


def test_repeats_differ_on_the_way_and_at_the_end(demonstrations: Demonstrations) -> None:
    by_berry = demonstrations.joints.reshape(6, 5, 150, 7)
    assert (by_berry[:, :, 50].std(axis=1).mean(axis=0) > 0.01).all()
    assert (by_berry[:, :, -1].std(axis=1).mean(axis=0) > 0.005).all()


def test_same_seed_same_reaches_other_seed_others() -> None:
    first, second, other = (simulate_demonstrations(np.random.default_rng(s), 1, 2, 20) for s in (5, 5, 6))
    np.testing.assert_array_equal(first.joints, second.joints)
    assert not np.allclose(first.joints, other.joints)


def test_selection(demonstrations: Demonstrations) -> None:
    chosen = demonstrations.select(demonstrations.configuration == 2)
    assert len(chosen) == 5
    np.testing.assert_array_equal(chosen.joints, demonstrations.joints[10:15])


def test_spreads_are_about_those_of_the_recordings() -> None:
    """Standard deviation of the last joints of repeats, against the lab's two sets of demonstrations."""
    points = np.array([[0.74, 0.05, 0.7], [0.76, -0.1, 0.75], [0.75, -0.05, 0.8], [0.73, 0.0, 0.66]])
    for style, recorded in (
        (REACH_LIKE, [0.051, 0.028, 0.081, 0.027, 0.029, 0.071, 0.055]),
        (THESIS_LIKE, [0.05, 0.11, 0.05, 0.16, 0.10, 0.23, 0.34]),
    ):
        ends = reach_to(np.random.default_rng(0), points, 10, 12, style=style).joints[:, -1]
        spread = ends.reshape(4, 10, 7).std(axis=1).mean(axis=0)
        assert 0.3 < np.linalg.norm(spread) / np.linalg.norm(recorded) < 4.0
        assert spread[[0, 2]].max() < 0.15  # the elbow stays where it is


def test_reaches_to_given_points() -> None:
    points = np.array([[0.74, 0.05, 0.7], [0.76, -0.1, 0.75]])
    reaches = reach_to(np.random.default_rng(0), points, repeats=2, samples=40)
    np.testing.assert_array_equal(reaches.targets, np.repeat(points, 2, axis=0))
    with pytest.raises(ConfigurationError, match="no comfortable reach"):
        reach_to(np.random.default_rng(0), [[2.0, 0.0, 0.7]], repeats=1, samples=5)
    with pytest.raises(ShapeError, match=r"\(C, 3\)"):
        reach_to(np.random.default_rng(0), [0.7, 0.0, 0.7])


def test_refusals(demonstrations: Demonstrations) -> None:
    with pytest.raises(ConfigurationError, match="configurations and repeats"):
        simulate_demonstrations(np.random.default_rng(0), configurations=0)
    with pytest.raises(ShapeError, match="targets"):
        Demonstrations(
            demonstrations.joints,
            demonstrations.targets[:3],
            demonstrations.configuration,
            demonstrations.durations,
        )
