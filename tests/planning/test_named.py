import pytest

from punnet.errors import BundleError, ConfigurationError
from punnet.planning import FusedPlanner, planner_named
from punnet.planning.named import DEFAULT_PLANNER


def test_planners_by_name():
    assert isinstance(planner_named(DEFAULT_PLANNER), FusedPlanner)
    assert planner_named("deep-promp").model.name == "full-task"
    assert planner_named("deep-promp", bundle="reach-sim:l-cvae-task").model.needs_picture
    assert planner_named("promp-depth", bundle="promp-reach-sim").name == "promp-depth"
    with pytest.raises(ConfigurationError, match=r"'rrt'.*promp-depth.*fused"):
        planner_named("rrt")
    with pytest.raises(BundleError, match="nowhere"):
        planner_named("deep-promp", bundle="nowhere")
    with pytest.raises(BundleError, match="kind"):
        planner_named("fused", bundle="promp-reach-sim")
