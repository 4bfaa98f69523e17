"""A way to run the command in this process, and a frame that needs no simulator."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from punnet.cli import main
from punnet.geometry import CameraIntrinsics
from punnet.harvest.benchmark import BenchmarkSettings
from punnet.harvest.benchmark_plants import AttemptResult, PlantResult
from punnet.harvest.judge import Fate
from punnet.robot import HOME, T_FLANGE_CAMERA, Panda
from punnet.scene import Frame


@dataclass(frozen=True)
class Result:
    """How the command ended, and what it printed."""

    code: int
    out: str
    err: str

    def fails_with(self, *words: str, code: int = 1) -> None:
        """Check the exit code, and one line on stderr that has all the words and no traceback."""
        assert self.code == code, self.err
        assert "Traceback" not in self.err
        lines = [line for line in self.err.splitlines() if line.startswith("punnet: ")]
        assert lines, self.err
        for word in words:
            assert word in self.err


@pytest.fixture
def punnet(capsys: pytest.CaptureFixture[str]) -> Iterator[Callable[..., Result]]:
    """Run ``punnet ...`` and give its exit code and output."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def run(*arguments: object) -> Result:
        with pytest.raises(SystemExit) as exit_info:
            main([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        return Result(int(exit_info.value.code or 0), printed.out, printed.err)

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)


def draw_frame(*, with_berry: bool = True) -> Frame:
    """A wall 0.9 m away; before it a ripe berry of 30 by 38 mm at (0.75, 0, 0.7) m in the base frame."""
    camera = CameraIntrinsics(640, 480, 615.0, 615.0, 319.5, 239.5)
    rgb = np.full((480, 640, 3), (88, 104, 78), dtype=np.uint8)
    rgb += np.random.default_rng(0).integers(0, 12, rgb.shape, dtype=np.uint8)
    depth = np.full((480, 640), 0.9, dtype=np.float32)
    T_base_camera = Panda().forward_kinematics(HOME) @ T_FLANGE_CAMERA
    if with_berry:
        x, y, z = np.linalg.solve(T_base_camera, np.array([0.75, 0.0, 0.7, 1.0]))[:3]
        centre = (round(camera.fx * x / z + camera.cx), round(camera.fy * y / z + camera.cy))
        half_width, half_length = camera.fx * 0.015 / z, camera.fx * 0.019 / z
        v, u = np.mgrid[:480, :640]
        radius = ((u - centre[0]) / half_width) ** 2 + ((v - centre[1]) / half_length) ** 2
        rgb[radius < 1] = (196, 24, 36)
        depth[radius < 1] = z - 0.015 * np.sqrt(1.0 - radius[radius < 1])
        top = centre[1] - round(half_length)
        cv2.ellipse(rgb, (centre[0], top), (round(half_width / 2), 4), 0, 0, 360, (70, 130, 50), cv2.FILLED)
        cv2.line(rgb, (centre[0], top - 60), (centre[0], top), (80, 140, 60), 3)
    return Frame(rgb=rgb, depth=depth, camera=camera, name="drawn")


@pytest.fixture(scope="session")
def frame_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """``rgb.png``, ``depth.png``, ``camera.json`` of a frame with one ripe berry in reach."""
    return draw_frame().save(tmp_path_factory.mktemp("frames") / "berry")


@pytest.fixture(scope="session")
def bare_frame_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same without the berry."""
    return draw_frame(with_berry=False).save(tmp_path_factory.mktemp("frames") / "bare")


@pytest.fixture
def corrupt_image(tmp_path: Path) -> Path:
    """A PNG that ends too early."""
    whole = cv2.imencode(".png", np.zeros((50, 50, 3), dtype=np.uint8))[1].tobytes()
    path = tmp_path / "corrupt.png"
    path.write_bytes(whole[:20])
    return path


@pytest.fixture
def unwritable(tmp_path: Path) -> Path:
    """A folder that not even root can make: its parent is a file."""
    blocker = tmp_path / "file"
    blocker.write_text("in the way")
    return blocker / "out"


@pytest.fixture
def taken(tmp_path: Path) -> Path:
    """A folder that exists and was not made by punnet."""
    folder = tmp_path / "taken"
    folder.mkdir()
    (folder / "thesis.txt").write_text("the only copy")
    return folder


@pytest.fixture(scope="session")
def frame_options() -> Callable[..., list[str]]:
    """``--rgb … --depth … --camera …`` of a frame folder, some of them replaced.

    The berry is drawn, so the detector is the one that finds what is red.
    """

    def options(folder: Path, **others: Path) -> list[str]:
        files = {"rgb": folder / "rgb.png", "depth": folder / "depth.png", "camera": folder / "camera.json"}
        chosen = [text for name, path in (files | others).items() for text in (f"--{name}", str(path))]
        return [*chosen, "--detector", "colour"]

    return options


FATE = {"index": 0, "stage": "ripe", "pluckable": True, "reachable": True, "mass": 20.0, "detached": True}
PLANT = PlantResult(
    0,
    7,
    (
        Fate(**FATE, punnet=0, peak_force=2.0, tool_force=0.0),
        Fate(**{**FATE, "index": 1, "detached": False}, punnet=None, peak_force=0.0, tool_force=0.0),
    ),
    (
        AttemptResult("picked", "place", aimed=0, estimate=21.0, true_weight=20.0, cut_error=0.003),
        AttemptResult("failed", "grip", "nothing between the pads", 1),
    ),
    seconds_simulated=20.0,
    seconds_computing=0.5,
)


@pytest.fixture
def one_plant(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str, str]]:
    """The commands as they are, with one plant that needs no simulator; of each harvest what it was told."""
    harvests: list[tuple[str, str, str]] = []

    def harvested(settings: BenchmarkSettings, number: int) -> PlantResult:
        harvests.append((settings.suite, settings.perception, settings.choice))
        return PLANT

    monkeypatch.setattr("punnet.harvest.benchmark.run_plant", harvested)
    return harvests
