"""The formats of demonstrations that are read, by name, and which of them lies at a path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from punnet.data.demos.bags import is_bag, read_bags
from punnet.data.demos.episode import DemonstrationSet
from punnet.data.demos.lab_json import is_lab_json, read_lab_json
from punnet.data.demos.lerobot_reader import is_lerobot, read_lerobot
from punnet.data.demos.punnet_folder import is_punnet_folder, read_punnet_folder
from punnet.data.demos.reach import is_reach, read_reach
from punnet.data.demos.reading import Reading
from punnet.data.demos.thesis_zip import is_thesis_zip, read_thesis_zip
from punnet.errors import ConfigurationError, FileFormatError

__all__ = ["DEMO_FORMATS", "DemoFormat", "guess_demo_format", "read_demos", "read_readable_demos"]


@dataclass(frozen=True)
class DemoFormat:
    """One format.

    Parameters
    ----------
    name
        What to call it on the command line.
    description
        One line: what has to be at the path.
    read
        Path to what could be read.
    recognises
        Whether a path that exists holds this format.
    """

    name: str
    description: str
    read: Callable[[Path], Reading]
    recognises: Callable[[Path], bool]


DEMO_FORMATS: dict[str, DemoFormat] = {
    known.name: known
    for known in (
        DemoFormat(
            "punnet",
            "folder with demonstrations.json, as punnet writes it",
            read_punnet_folder,
            is_punnet_folder,
        ),
        DemoFormat("lerobot", "LeRobotDataset v3: folder with meta/info.json", read_lerobot, is_lerobot),
        DemoFormat("reach", "folder with index.json and promp_weights.npz", read_reach, is_reach),
        DemoFormat(
            "bag",
            "rosbag1, rosbag2 or MCAP recording, or a folder of them",
            read_bags,
            is_bag,
        ),
        DemoFormat(
            "thesis",
            "annotation.zip of the thesis, or its folder with J1 … J7",
            read_thesis_zip,
            is_thesis_zip,
        ),
        DemoFormat(
            "lab-json", "JSON with joint_position and time, or a folder of them", read_lab_json, is_lab_json
        ),
    )
}


def read_demos(path: str | Path, format: str | None = None) -> DemonstrationSet:  # noqa: A002
    """Read demonstrations of any format in :data:`DEMO_FORMATS`, all of them or none.

    Parameters
    ----------
    path
        A file or a folder.
    format
        A name in :data:`DEMO_FORMATS`; guessed from what is at the path if None.

    Raises
    ------
    FileFormatError
        If nothing is at the path, its format can't be guessed, or an episode can't be read.
    ConfigurationError
        If there is no such format, or the package that it needs is not installed.
    """
    reading = read_readable_demos(path, format)
    demonstrations = reading.demonstrations()
    if reading.left_out:
        more = f" (and {len(reading.left_out) - 1} more faults)" if len(reading.left_out) > 1 else ""
        raise FileFormatError(
            f"{reading.left_out[0]}{more}; see punnet demos validate, or convert to leave it out"
        )
    return demonstrations


def read_readable_demos(path: str | Path, format: str | None = None) -> Reading:  # noqa: A002
    """Read what can be read; faulty episodes are left out, and said why.

    Raises
    ------
    FileFormatError
        If nothing is at the path, its format can't be guessed, or it is damaged as a whole.
    ConfigurationError
        If there is no such format, or the package that it needs is not installed.
    """
    path = Path(path)
    if not path.exists():
        raise FileFormatError(f"{path}: no such file or folder")
    name = guess_demo_format(path) if format is None else format
    if name not in DEMO_FORMATS:
        raise ConfigurationError(f"no format of demonstrations '{name}'; there are {', '.join(DEMO_FORMATS)}")
    reading = DEMO_FORMATS[name].read(path)
    if not reading.episodes and not reading.left_out:
        raise FileFormatError(f"{path}: holds no demonstration; {name} is a {DEMO_FORMATS[name].description}")
    reading.drop_other_arms()
    return reading


def guess_demo_format(path: str | Path) -> str:
    """Name of the first format that recognises what is at the path.

    Raises
    ------
    FileFormatError
        If none does; the message lists what is possible.
    """
    for name, known in DEMO_FORMATS.items():
        if known.recognises(Path(path)):
            return name
    listed = "; ".join(f"{name} ({known.description})" for name, known in DEMO_FORMATS.items())
    raise FileFormatError(f"{path}: no known demonstrations; say with --format which it is, one of: {listed}")
