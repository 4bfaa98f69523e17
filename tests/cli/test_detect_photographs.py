"""``punnet detect`` on photographs as people have them, and with detectors of their own."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from punnet.scene import Strawberries
from tests.perception.toy_detector import write_toy_bundle
from tests.scene.pictures import boastful_png, encoded, turned_jpeg


def berry(height: int = 300, width: int = 400) -> np.ndarray:
    """One red disc on green, right of the middle."""
    rgb = np.full((height, width, 3), (80, 120, 70), dtype=np.uint8)
    cv2.circle(rgb, (round(0.7 * width), height // 2), height // 6, (205, 25, 30), cv2.FILLED)
    return rgb


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_toy_bundle(tmp_path_factory.mktemp("bundles") / "toy")


def everything(folder: Path) -> tuple[list[str], list[str]]:
    """Good and bad photographs in a folder; their names."""
    grey = np.full((300, 400), 90, dtype=np.uint8)
    good = {
        "alpha.png": encoded(np.dstack((berry(), np.full((300, 400), 128, dtype=np.uint8)))),
        "deep.png": encoded(berry().astype(np.uint16) * 257),
        "grey.png": encoded(grey),
        "small.png": encoded(berry()[:1, :1]),
        "turned.jpg": turned_jpeg(np.rot90(berry(), 1), 6),
        "usual.jpg": encoded(berry(), ".jpg"),
    }
    bad = {
        "boast.png": boastful_png(),
        "empty.jpg": b"",
        "text.jpg": b"not a photograph",
        "truncated.jpg": encoded(berry(), ".jpg")[:-900],
    }
    folder.mkdir()
    for name, content in (good | bad).items():
        (folder / name).write_bytes(content)
    return sorted(good), sorted(bad)


@pytest.mark.parametrize("detector", ["colour", "toy"])
def test_each_photograph_is_right_or_left_out_with_the_reason(
    punnet: Callable, tmp_path: Path, toy: Path, detector: str
) -> None:
    good, bad = everything(tmp_path / "photos")
    out = tmp_path / "out"
    source = toy if detector == "toy" else detector
    result = punnet("detect", tmp_path / "photos", "--out", out, "--detector", source, "--json")
    assert result.code == 1
    assert "Traceback" not in result.err
    for name in bad:
        assert f"{name}: not an image" in result.err
    found = {Path(item["photo"]).name: item for item in json.loads(result.out)["photos"]}
    assert sorted(name for name, item in found.items() if item["error"] is None) == good
    assert {name: found[name]["berries"] for name in good} == {
        name: int(name not in ("grey.png", "small.png")) for name in good
    }
    for name in ("alpha", "deep", "turned", "usual"):
        # The photograph stored on its side has its berry where the others have it.
        berries = Strawberries.from_json(json.loads((out / "berries" / f"{name}.json").read_text()))
        assert berries.image_size == (300, 400)
        v, u = np.nonzero(berries.masks[0])
        assert (u.mean(), v.mean()) == pytest.approx((280, 150), abs=6)


def test_a_photograph_of_48_megapixels(punnet: Callable, tmp_path: Path, toy: Path) -> None:
    photo = tmp_path / "large.jpg"
    photo.write_bytes(encoded(berry(6000, 8000), ".jpg"))
    result = punnet("detect", photo, "--out", tmp_path / "out", "--detector", toy, "--json")
    assert result.code == 0, result.err
    assert json.loads(result.out)["photos"][0]["berries"] == 1
    assert cv2.imread(str(tmp_path / "out" / "overlays" / "large.jpg")).shape == (6000, 8000, 3)


def test_the_score_is_the_detectors_own_unless_given(punnet: Callable, tmp_path: Path, toy: Path) -> None:
    photo = tmp_path / "photo.png"
    photo.write_bytes(encoded(berry()))
    for options, count in (((), 1), (("--score", "0.95"), 0)):
        result = punnet(
            "detect", photo, "--out", tmp_path / "out", "--detector", toy, "--json", "--force", *options
        )
        assert json.loads(result.out)["photos"][0]["berries"] == count


def test_what_a_model_must_not_be_used_for_is_said(
    punnet: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = {"restriction": "non-commercial use only", "citation": "A. Author: Berries, 2020"}
    bound = write_toy_bundle(tmp_path / "models" / "bound", name="bound", **said)
    photo = tmp_path / "photo.png"
    photo.write_bytes(encoded(berry()))
    monkeypatch.setattr("punnet.perception.choosing.PHOTOGRAPH_DETECTOR", str(bound))
    result = punnet("detect", photo, "--out", tmp_path / "out")
    assert result.code == 0
    assert "detector bound: non-commercial use only; punnet models says what to cite" in result.err
    assert (
        "non-commercial"
        not in punnet("detect", photo, "--out", tmp_path / "out", "--force", "--detector", "colour").err
    )
    listed = punnet("models", tmp_path / "models")
    assert "non-commercial use only" in listed.out
    assert "A. Author: Berries, 2020" in listed.out


@pytest.mark.parametrize("command", ["detect", "weigh", "plan", "harvest", "demo", "benchmark harvest"])
def test_a_detector_that_cannot_be_had(
    punnet: Callable, tmp_path: Path, toy: Path, frame_folder: Path, frame_options: Callable, command: str
) -> None:
    arguments = {
        "detect": [frame_folder / "rgb.png", "--out", tmp_path / "out"],
        "weigh": frame_options(frame_folder)[:-2],
        "plan": frame_options(frame_folder)[:-2],
        "benchmark harvest": [],
    }.get(command, ["--out", tmp_path / "out"])
    words = command.split()
    punnet(*words, *arguments, "--detector", "no-such").fails_with("no-such", "neither a folder nor a bundle")
    (toy.parent / "damaged").mkdir(exist_ok=True)
    for path in toy.iterdir():
        (toy.parent / "damaged" / path.name).write_bytes(path.read_bytes() + b" " * (path.suffix == ".onnx"))
    punnet(*words, *arguments, "--detector", toy.parent / "damaged").fails_with("checksum", "copy the bundle")
    assert not (tmp_path / "out").exists()


def test_weigh_and_plan_take_a_detector(
    punnet: Callable, toy: Path, frame_folder: Path, frame_options: Callable
) -> None:
    options = [*frame_options(frame_folder)[:-2], "--detector", toy]
    assert json.loads(punnet("weigh", *options, "--json").out)["berries"][0]["weight_g"] > 8
    assert json.loads(punnet("plan", *options, "--json").out)["picking_point"][2] == pytest.approx(
        0.73, abs=0.03
    )


def test_oracle_and_detector_contradict_each_other(punnet: Callable, tmp_path: Path) -> None:
    for command in (("harvest", "--out", tmp_path / "out"), ("benchmark", "harvest")):
        punnet(*command, "--oracle", "--detector", "colour").fails_with("--oracle", "leave --detector out")
