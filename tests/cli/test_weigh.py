"""``punnet weigh``: grams of a drawn berry, and bad input."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from punnet.scene import Strawberries


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
    assert f"{berries[0]['weight_g']:.1f}" in table.out


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
