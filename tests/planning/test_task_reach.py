import numpy as np
import pytest

from punnet.errors import KinematicsError, PlanningError
from punnet.movement import PoseViaPoint, condition_on_poses, retime, to_task_space
from punnet.planning import ProMPDepthPlanner
from punnet.planning.task_reach import joints_along
from punnet.robot import HOME, PANDA_LIMITS, Panda

ARM = Panda()
REACH = ProMPDepthPlanner.from_bundle().promp.broadened(0.02)
TASK = to_task_space(REACH, ARM.tool_kinematics)


def test_the_tool_follows_the_mean_within_the_limits_of_the_arm() -> None:
    home = PoseViaPoint(0.0, ARM.forward_kinematics_tool(HOME))
    distribution = condition_on_poses(TASK, [home])
    joints = joints_along(distribution, HOME, samples=60)
    poses = distribution.chart.poses(distribution.mean(np.linspace(0.0, 1.0, 60)))
    np.testing.assert_allclose(ARM.forward_kinematics_tool(joints), poses, atol=1e-9)
    np.testing.assert_allclose(joints[0], HOME, atol=1e-4)
    assert retime(joints, PANDA_LIMITS).duration < 3.0


def test_refusals() -> None:
    with pytest.raises(PlanningError, match="over joints already"):
        joints_along(REACH, HOME)
    far = ARM.forward_kinematics_tool(HOME)
    far[:3, 3] += (0.9, 0.0, 0.0)
    beyond = condition_on_poses(TASK.broadened(0.3), [PoseViaPoint(1.0, far)])
    with pytest.raises(KinematicsError, match="pose"):
        joints_along(beyond, HOME, samples=30)
