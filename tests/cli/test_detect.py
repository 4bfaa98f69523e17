"""``punnet detect``: what it writes, and what it says about bad input."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import pytest

from punnet.outputs import MARKER_FILE
from punnet.scene import Strawberries

# A shell that runs the tests in the background has Ctrl-C ignored, and its children inherit that.
COMMAND = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from punnet.cli import main
main()
"""


@pytest.fixture
def photos(tmp_path: Path, frame_folder: Path, bare_frame_folder: Path) -> Path:
    folder = tmp_path / "photos"
    folder.mkdir()
    shutil.copy(frame_folder / "rgb.png", folder / "berry.png")
    shutil.copy(bare_frame_folder / "rgb.png", folder / "bare.png")
    (folder / "notes.txt").write_text("not a photograph")
    return folder


def test_folder_gives_overlays_json_and_coco(punnet, photos: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "found"
    result = punnet("detect", photos, "--out", out, "--json", "--detector", "colour")
    assert result.code == 0, result.err
    summary = json.loads(result.out)
    assert [(Path(item["photo"]).name, item["berries"] > 0) for item in summary["photos"]] == [
        ("bare.png", False),
        ("berry.png", True),
    ]
    for item in summary["photos"]:
        assert cv2.imread(str(out / item["overlay"])).shape == (480, 640, 3)
    berries = Strawberries.from_json(json.loads((out / "berries" / "berry.json").read_text()))
    assert berries.pluckable.sum() == 1
    coco = json.loads((out / "detections.json").read_text())
    assert [(out / image["file_name"]).resolve() for image in coco["images"]] == [
        photos / "bare.png",
        photos / "berry.png",
    ]
    assert len(coco["annotations"]) == sum(item["berries"] for item in summary["photos"])


def test_one_photograph_without_berries_is_no_error(punnet, bare_frame_folder: Path, tmp_path: Path) -> None:
    photo = bare_frame_folder / "rgb.png"
    result = punnet("detect", photo, "--out", tmp_path / "out", "--detector", "colour")
    assert result.code == 0
    assert "0 berries in 1 photographs" in result.out


def test_high_score_leaves_out_the_unsure(punnet, frame_folder: Path, tmp_path: Path) -> None:
    result = punnet(
        "detect", frame_folder / "rgb.png", "--out", tmp_path / "out", "--score", "0.999", "--json"
    )
    assert json.loads(result.out)["photos"][0]["berries"] == 0


def test_bad_photographs_are_left_out_and_said_so(
    punnet, photos: Path, corrupt_image: Path, tmp_path: Path
) -> None:
    shutil.copy(corrupt_image, photos / "corrupt.png")
    out = tmp_path / "out"
    result = punnet("detect", photos, "--out", out)
    result.fails_with("corrupt.png", "1 of 3 photographs left out")
    assert "2 photographs" in result.out
    assert (out / "overlays" / "berry.jpg").is_file()
    assert len(json.loads((out / "detections.json").read_text())["images"]) == 2


def test_same_stem_twice_is_kept_apart(punnet, photos: Path, tmp_path: Path) -> None:
    cv2.imwrite(str(photos / "berry.jpg"), cv2.imread(str(photos / "berry.png")))
    punnet("detect", photos, "--out", tmp_path / "out")
    assert len(list((tmp_path / "out" / "overlays").iterdir())) == 3


def test_nothing_readable_leaves_no_folder(punnet, corrupt_image: Path, tmp_path: Path) -> None:
    punnet("detect", corrupt_image, "--out", tmp_path / "out").fails_with("corrupt.png", "damaged")
    assert not (tmp_path / "out").exists()
    assert not list(tmp_path.glob(".out*"))


def test_missing_and_empty_input(punnet, tmp_path: Path) -> None:
    punnet("detect", tmp_path / "nowhere", "--out", tmp_path / "out").fails_with("nowhere", "no such file")
    (tmp_path / "empty").mkdir()
    punnet("detect", tmp_path / "empty", "--out", tmp_path / "out").fails_with("empty", "no photographs")


def test_unwritable_output(punnet, photos: Path, unwritable: Path) -> None:
    punnet("detect", photos, "--out", unwritable).fails_with(str(unwritable), "a file stands where a folder")


def test_existing_output_needs_force_and_to_be_ours(
    punnet, photos: Path, taken: Path, tmp_path: Path
) -> None:
    punnet("detect", photos, "--out", taken).fails_with("exists", "--force")
    punnet("detect", photos, "--out", taken, "--force").fails_with("not made by punnet")
    assert (taken / "thesis.txt").read_text() == "the only copy"
    out = tmp_path / "out"
    assert punnet("detect", photos, "--out", out).code == 0
    (out / "overlays" / "old.jpg").write_text("of the last run")
    punnet("detect", photos, "--out", out).fails_with("exists", "--force")
    assert punnet("detect", photos, "--out", out, "--force").code == 0
    assert not (out / "overlays" / "old.jpg").exists()


def test_interrupt_keeps_what_was_finished_and_says_so(photos: Path, tmp_path: Path) -> None:
    many = tmp_path / "many"
    many.mkdir()
    for number in range(600):
        (many / f"{number:03d}.png").symlink_to(photos / "berry.png")
    out = tmp_path / "out"
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, "detect", str(many), "--out", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 60
    while len(list(tmp_path.glob(".out-*/overlays/*.jpg"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert f"interrupted; kept what was finished in {out}" in err
    assert "Traceback" not in err
    kept = len(list((out / "overlays").iterdir()))
    assert 3 <= kept < 600
    assert len(json.loads((out / "detections.json").read_text())["images"]) >= kept - 1
    assert json.loads((out / MARKER_FILE).read_text())["complete"] is False
    assert not list(tmp_path.glob(".out-*"))
