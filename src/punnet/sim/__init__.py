"""The simulated world: plants, berries, the arm with its picker, the D435i, and the truth about them."""

from punnet.sim.cluster import ClusterConfig
from punnet.sim.depth_sensor import StereoDepthModel
from punnet.sim.rendering import CameraRenderer
from punnet.sim.simulated_robot import SimulatedRobot
from punnet.sim.truth import true_strawberries
from punnet.sim.world import World, WorldConfig, build_world

__all__ = [
    "CameraRenderer",
    "ClusterConfig",
    "SimulatedRobot",
    "StereoDepthModel",
    "World",
    "WorldConfig",
    "build_world",
    "true_strawberries",
]
