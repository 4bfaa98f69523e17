"""Demonstrations: one data model, readers and writers one file a format."""

from punnet.data.demos.episode import DemonstrationSet, Episode, Photograph
from punnet.data.demos.faults import DEMO_FAULTS, DemoFault, DemoReport
from punnet.data.demos.formats import DEMO_FORMATS, read_demos, read_readable_demos
from punnet.data.demos.lerobot_writer import write_lerobot
from punnet.data.demos.pairing import SuspectTarget, suspect_targets
from punnet.data.demos.pictures import PictureFile, mark_target, target_picture
from punnet.data.demos.punnet_writer import write_punnet_folder
from punnet.data.demos.trajectory import Trajectory, WeightDistribution, as_poses
from punnet.data.demos.validation import check_demonstrations, validate_demos

__all__ = [
    "DEMO_FAULTS",
    "DEMO_FORMATS",
    "DemoFault",
    "DemoReport",
    "DemonstrationSet",
    "Episode",
    "Photograph",
    "PictureFile",
    "SuspectTarget",
    "Trajectory",
    "WeightDistribution",
    "as_poses",
    "check_demonstrations",
    "mark_target",
    "read_demos",
    "read_readable_demos",
    "suspect_targets",
    "target_picture",
    "validate_demos",
    "write_lerobot",
    "write_punnet_folder",
]
