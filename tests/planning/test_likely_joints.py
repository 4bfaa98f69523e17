import numpy as np
from scipy.optimize import minimize

from punnet.geometry import pose_error
from punnet.planning.likely_joints import likely_joints
from punnet.robot import HOME, Panda

ARM = Panda()


def test_poses_are_met_and_nothing_near_is_more_likely() -> None:
    rng = np.random.default_rng(1)
    factor = rng.normal(size=(7, 7))
    covariance = 0.02 * factor @ factor.T + 0.02 * np.eye(7)
    poses = ARM.forward_kinematics_tool(HOME + rng.normal(0.0, 0.15, (30, 7)))
    joints, distance = likely_joints(ARM, poses, HOME, covariance)
    assert np.isfinite(distance).mean() > 0.9
    found = np.isfinite(distance)
    metres, radians = pose_error(ARM.forward_kinematics_tool(joints[found]), poses[found])
    assert max(metres.max(), radians.max()) < 1e-6
    # At the optimum the gradient Σ⁻¹(q − m) has no part along the arm's self-motion.
    for q in joints[found]:
        gradient = np.linalg.solve(covariance, q - HOME)
        self_motion = np.linalg.svd(ARM.jacobian(q))[2][-1]
        assert abs(self_motion @ gradient) < 2e-3 * max(1.0, np.linalg.norm(gradient))


def test_agrees_with_a_general_optimiser() -> None:
    covariance = np.diag([0.1, 0.2, 0.1, 0.3, 0.2, 0.1, 0.2])
    pose = ARM.forward_kinematics_tool(HOME + np.array([0.1, 0.2, -0.1, 0.2, 0.1, -0.1, 0.1]))
    joints, distance = likely_joints(ARM, pose, HOME, covariance)

    def left(q: np.ndarray) -> np.ndarray:
        return (ARM.forward_kinematics_tool(q) - pose)[:3].ravel()[[1, 2, 3, 6, 7, 11]]

    def cost(q: np.ndarray) -> float:
        return float((q - HOME) @ np.linalg.solve(covariance, q - HOME))

    reference = minimize(
        cost, HOME, constraints={"type": "eq", "fun": left}, tol=1e-12, options={"maxiter": 500}
    )
    np.testing.assert_allclose(joints, reference.x, atol=1e-4)
    assert abs(float(distance) - reference.fun) < 1e-5


def test_out_of_reach_is_nan_with_infinite_distance_and_does_not_spoil_others() -> None:
    poses = np.stack([ARM.forward_kinematics_tool(HOME)] * 2)
    poses[1, :3, 3] = (2.0, 0.0, 0.5)
    joints, distance = likely_joints(ARM, poses, HOME, np.eye(7))
    np.testing.assert_allclose(joints[0], HOME, atol=1e-8)
    assert np.isnan(joints[1]).all()
    assert np.isinf(distance[1])
