"""Figure 6.12: predictions carried out before the plants that they are for."""

from dataclasses import replace

import numpy as np
import pytest

from punnet.data.demos import read_demos
from punnet.errors import ConfigurationError
from punnet.planning.reaches import Movements, reaches_from
from punnet.sim.demonstrations_factory import simulate_demonstration_set
from punnet.train.planner.charts_6 import draw_figure_6_12
from punnet.train.planner.executed import NOT_FOLLOWED, execute_predictions
from punnet.train.planner.tables_6 import figure_6_12


@pytest.fixture(scope="module")
def demonstrations(tmp_path_factory):
    folder = tmp_path_factory.mktemp("executed") / "set"
    simulate_demonstration_set(folder, configurations=2, repeats=2, seed=5, scene="multi", samples=60)
    return read_demos(folder)


@pytest.fixture(scope="module")
def reaches(demonstrations):
    return reaches_from(demonstrations)


def certain(movements, targets):
    """What was demonstrated of each photograph's target, as a prediction that is nearly sure."""
    found = movements[targets]
    return Movements(found.mean, 1e-3 * found.covariance)


@pytest.fixture(scope="module")
def executed(demonstrations, reaches):
    joint, task = (certain(movements, reaches.targets) for movements in (reaches.joint, reaches.pose))
    far = task.mean.copy()
    far[:, 0] += 1.0
    predictions = {
        "cvae-joint": ("joint", joint),
        "l-cvae-joint": ("joint", joint),
        "cvae-task": ("task", task),
        "l-cvae-task": ("task", task),
        "vae-task": ("task", Movements(far, task.covariance)),
    }
    return execute_predictions(predictions, demonstrations, reaches)


def test_the_arm_comes_to_where_it_was_told(executed):
    for network in ("cvae-joint", "l-cvae-task"):
        for beside in (False, True):
            found = executed.of(network, beside=beside)
            assert len(found) == (4 if beside else 2)
            for reach in found:
                if reach.reason is None:
                    assert reach.position < 0.02
                    assert reach.orientation < 0.05
                assert reach.way.shape[1] == 3
    assert any(reach.reason is None for reach in executed.of("l-cvae-task", beside=False))


def test_both_spaces_lead_to_the_same_end(executed):
    ends = [
        [reach.way[-1] for reach in executed.of(name, beside=False)] for name in ("cvae-joint", "cvae-task")
    ]
    assert np.abs(np.array(ends[0]) - np.array(ends[1])).max() < 0.02


def test_what_can_not_be_followed_is_counted(executed):
    for reach in executed.of("vae-task", beside=False):
        assert (reach.reason, reach.moved) == (NOT_FOLLOWED, False)
    rows = {row[0]: row for row in figure_6_12(executed).rows}
    assert rows["vae-task"][1] == "–"
    assert rows["vae-task"][5] == "0 of 6"
    assert float(rows["cvae-joint"][1]) < 0.02


def test_it_is_drawn(executed, tmp_path):
    drawn = draw_figure_6_12(executed, tmp_path / "12.png")
    assert drawn["position_m"] < 0.03
    assert (tmp_path / "12.png").read_bytes()[:4] == b"\x89PNG"


def test_plants_of_another_version_are_refused(demonstrations, reaches):
    predictions = {"cvae-task": ("task", certain(reaches.pose, reaches.targets))}
    old = replace(demonstrations, info=demonstrations.info | {"generator": 0})
    with pytest.raises(ConfigurationError, match="generator 0"):
        execute_predictions(predictions, old, reaches)
    foreign = replace(demonstrations, info={})
    with pytest.raises(ConfigurationError, match="no simulated set"):
        execute_predictions(predictions, foreign, reaches)
