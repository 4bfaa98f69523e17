"""Camera intrinsics, rigid transforms, quaternions and point clouds. NumPy only."""

from punnet.geometry.camera import CameraIntrinsics
from punnet.geometry.points import back_project, cloud_from_depth, project
from punnet.geometry.quaternions import (
    continuous_quaternions,
    quaternion_angle,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from punnet.geometry.transforms import (
    invert_transform,
    is_transform,
    make_transform,
    pose_error,
    rotation_from_vector,
    transform_points,
    vector_from_rotation,
)

__all__ = [
    "CameraIntrinsics",
    "back_project",
    "cloud_from_depth",
    "continuous_quaternions",
    "invert_transform",
    "is_transform",
    "make_transform",
    "pose_error",
    "project",
    "quaternion_angle",
    "quaternion_from_rotation",
    "rotation_from_quaternion",
    "rotation_from_vector",
    "transform_points",
    "vector_from_rotation",
]
