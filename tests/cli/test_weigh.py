"""``punnet weigh``: grams of a drawn berry, and bad input."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from punnet.scene import Strawberries
from tests.perception.toy_detector import write_toy_bundle as write_toy_detector
from tests.weight.toy_model import write_toy_bundle


def test_weighs_the_berry(punnet, frame_options, frame_folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "weighed"
    result = punnet("weigh", *frame_options(frame_folder), "--out", out, "--json")
    assert result.code == 0, result.err
    berries = json.loads(result.out)["berries"]
    low, high = berries[0]["weight_interval_g"]
    # An ellipsoid of 30 × 30 × 38 mm has 17.9 ml, and a berry weighs a little less than water.
    assert low < berries[0]["weight_g"] < high
    assert berries[0]["weight_g"] == pytest.approx(16.5, rel=0.25)
    assert berries[0]["reason"] is None
    assert cv2.imread(str(out / "overlay.png")).shape == (480, 640, 3)
    stored = Strawberries.from_json(json.loads((out / "strawberries.json").read_text()))
    assert stored.weights[0] == pytest.approx(berries[0]["weight_g"])
    table = punnet("weigh", *frame_options(frame_folder))
    assert "pluckable" in table.out
    assert f"{berries[0]['weight_g']:.1f} ± {(high - low) / 2:.1f}" in table.out


def test_the_estimator_is_chosen(punnet, frame_options, frame_folder: Path, tmp_path: Path) -> None:
    toy = write_toy_bundle(tmp_path / "toy")
    for estimator, name in ((toy, "toy-scale"), ("ellipsoid", "ellipsoid")):
        result = punnet("weigh", *frame_options(frame_folder), "--estimator", estimator, "--json")
        assert result.code == 0, result.err
        report = json.loads(result.out)
        assert report["estimator"] == name
        assert report["berries"][0]["weight_g"] == pytest.approx(16.5, rel=0.25)
    punnet("weigh", *frame_options(frame_folder), "--estimator", "kitchen").fails_with("kitchen", "neither")


@pytest.fixture
def why(punnet, frame_options, frame_folder: Path, tmp_path: Path) -> Callable[..., str]:
    """Why the berry, which a detector found that looks at colour alone, is not weighed."""
    detector = write_toy_detector(tmp_path / "detector")

    def ask(**files: Path) -> str:
        options = frame_options(frame_folder, **files)
        out = tmp_path / "weighed"
        result = punnet("weigh", *options, "--detector", detector, "--out", out, "--json", "--force")
        assert result.code == 0, result.err
        (berry,) = json.loads(result.out)["berries"]
        assert berry["weight_g"] is None
        assert berry["weight_interval_g"] is None
        assert (out / "overlay.png").exists()
        return str(berry["reason"])

    return ask


def test_depth_that_tells_nothing(why, frame_folder: Path, tmp_path: Path) -> None:
    """The berry is there, its weight is not, and it is said why."""
    path = tmp_path / "depth.png"
    depth = cv2.imread(str(frame_folder / "depth.png"), cv2.IMREAD_UNCHANGED)
    for other, word in (
        (np.zeros_like(depth), "no depth reading"),
        (depth * 10, "unit"),  # tenths of a millimetre
        (np.ones_like(depth), "unit"),  # whole metres
        (np.full_like(depth, 400), "flat"),
    ):
        cv2.imwrite(str(path), other)
        assert word in why(depth=path)


def test_millimetres_that_are_called_metres(
    punnet, frame_options, why, frame_folder: Path, tmp_path: Path
) -> None:
    description = json.loads((frame_folder / "camera.json").read_text())
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(description | {"depth_scale": 1.0}))
    punnet("weigh", *frame_options(frame_folder, camera=path)).fails_with("depth_scale", "metres per count")
    path.write_text(json.dumps(description | {"depth_scale": 0.9}))
    assert "millimetres" in why(camera=path)


def test_intrinsics_that_are_missing_or_of_another_resolution(
    punnet, frame_options, frame_folder: Path, tmp_path: Path
) -> None:
    description = json.loads((frame_folder / "camera.json").read_text())
    path = tmp_path / "camera.json"
    larger = description["camera"] | {"width": 1280, "height": 960}
    path.write_text(json.dumps(description | {"camera": larger}))
    punnet("weigh", *frame_options(frame_folder, camera=path)).fails_with("1280×960", "640×480")
    for empty in (description | {"camera": None}, {}):
        path.write_text(json.dumps(empty))
        punnet("weigh", *frame_options(frame_folder, camera=path)).fails_with(
            "camera.json: holds no camera", "fx"
        )


def test_no_berries_is_no_error(punnet, frame_options, bare_frame_folder: Path) -> None:
    result = punnet("weigh", *frame_options(bare_frame_folder))
    assert result.code == 0
    assert "no berries" in result.err
    assert json.loads(punnet("weigh", *frame_options(bare_frame_folder), "--json").out)["berries"] == []


@pytest.mark.parametrize("command", ["weigh", "plan"])
class TestBadInput:
    """The same for every command that takes an RGB-D frame."""

    @pytest.mark.parametrize("option", ["rgb", "depth", "camera"])
    def test_missing_file_and_folder(
        self, punnet, frame_options, command: str, option: str, frame_folder: Path, tmp_path: Path
    ) -> None:
        missing = frame_options(frame_folder, **{option: tmp_path / "nowhere"})
        punnet(command, *missing).fails_with("nowhere", "no such file")
        punnet(command, *frame_options(frame_folder, **{option: tmp_path})).fails_with(
            str(tmp_path), "is a folder"
        )

    @pytest.mark.parametrize("option", ["rgb", "depth"])
    def test_corrupt_image(
        self, punnet, frame_options, command: str, option: str, frame_folder: Path, corrupt_image: Path
    ) -> None:
        options = frame_options(frame_folder, **{option: corrupt_image})
        punnet(command, *options).fails_with("corrupt.png", "damaged")

    def test_camera_that_is_no_camera(
        self, punnet, frame_options, command: str, frame_folder: Path, tmp_path: Path
    ) -> None:
        for text, words in (("{", "JSON"), ("[1]", "object"), ('{"width": 640}', "'height' is missing")):
            (tmp_path / "camera.json").write_text(text)
            options = frame_options(frame_folder, camera=tmp_path / "camera.json")
            punnet(command, *options).fails_with("camera.json", words)

    def test_depth_of_another_size_or_kind(
        self, punnet, frame_options, command: str, frame_folder: Path, tmp_path: Path
    ) -> None:
        path = tmp_path / "depth.png"
        cv2.imwrite(str(path), np.full((240, 320), 700, dtype=np.uint16))
        punnet(command, *frame_options(frame_folder, depth=path)).fails_with("(240, 320)", "(480, 640)")
        cv2.imwrite(str(path), np.full((480, 640), 70, dtype=np.uint8))
        punnet(command, *frame_options(frame_folder, depth=path)).fails_with("depth.png", "16-bit")

    def test_unwritable_and_existing_output(
        self, punnet, frame_options, command: str, frame_folder: Path, unwritable: Path, taken: Path
    ) -> None:
        options = frame_options(frame_folder)
        punnet(command, *options, "--out", unwritable).fails_with(str(unwritable), "file stands")
        punnet(command, *options, "--out", taken).fails_with("exists", "--force")
        punnet(command, *options, "--out", taken, "--force").fails_with("not made by punnet")
        out = taken.parent / "out"
        assert punnet(command, *options, "--out", out).code == 0
        punnet(command, *options, "--out", out).fails_with("exists")
        assert punnet(command, *options, "--out", out, "--force").code == 0
