"""Movement primitives: basis, ProMP, trajectory distributions; joint trajectories and their timing."""

from punnet.movement.basis import GaussianBasis
from punnet.movement.conditioning import ViaPoint, condition_gaussian
from punnet.movement.distribution import Space, TrajectoryDistribution
from punnet.movement.joint_trajectory import JointTrajectory
from punnet.movement.promp import ProMP, shrunk_covariance
from punnet.movement.retiming import JointLimits, retime

__all__ = [
    "GaussianBasis",
    "JointLimits",
    "JointTrajectory",
    "ProMP",
    "Space",
    "TrajectoryDistribution",
    "ViaPoint",
    "condition_gaussian",
    "retime",
    "shrunk_covariance",
]
