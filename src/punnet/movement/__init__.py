"""Movement primitives: basis, ProMP, trajectory distributions; joint trajectories and their timing."""

from punnet.movement.basis import GaussianBasis
from punnet.movement.basis_choice import BasisChoice, choose_basis
from punnet.movement.blending import blend, combine
from punnet.movement.conditioning import condition_gaussian
from punnet.movement.distribution import Space, TrajectoryDistribution
from punnet.movement.expectation_maximisation import ExpectationMaximisation
from punnet.movement.joint_trajectory import JointTrajectory
from punnet.movement.kinematics import ForwardKinematics
from punnet.movement.pose_chart import PoseChart
from punnet.movement.pose_conditioning import PoseViaPoint, condition_on_poses
from punnet.movement.promp import ProMP
from punnet.movement.pushforward import from_quaternion_weights, in_basis, in_chart, to_task_space
from punnet.movement.regression import Ridge, shrunk_covariance
from punnet.movement.retiming import JointLimits, retime
from punnet.movement.via_point import ViaPoint

__all__ = [
    "BasisChoice",
    "ExpectationMaximisation",
    "ForwardKinematics",
    "GaussianBasis",
    "JointLimits",
    "JointTrajectory",
    "PoseChart",
    "PoseViaPoint",
    "ProMP",
    "Ridge",
    "Space",
    "TrajectoryDistribution",
    "ViaPoint",
    "blend",
    "choose_basis",
    "combine",
    "condition_gaussian",
    "condition_on_poses",
    "from_quaternion_weights",
    "in_basis",
    "in_chart",
    "retime",
    "shrunk_covariance",
    "to_task_space",
]
