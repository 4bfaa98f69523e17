"""``punnet data`` as a user sees it: what is written, what is said, how it ends."""

from __future__ import annotations

import http.client
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from punnet.data import read_dataset
from tests.data.conftest import HEIGHT, WIDTH, clean_coco


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A clean set of six images of three plants."""
    folder = tmp_path / "set"
    folder.mkdir()
    data = clean_coco()
    one, two = data["annotations"][:2]
    data["images"], data["annotations"] = [], []
    for number in range(1, 7):
        name = f"plant{(number - 1) // 2}-{number}.png"
        cv2.imwrite(str(folder / name), np.full((HEIGHT, WIDTH, 3), 30 * number, np.uint8))
        data["images"].append({"id": number, "file_name": name, "width": WIDTH, "height": HEIGHT})
        data["annotations"] += [
            {**one, "id": 2 * number, "image_id": number},
            {**two, "id": 2 * number + 1, "image_id": number},
        ]
    (folder / "annotations.json").write_text(json.dumps(data))
    return folder


def damage(folder: Path, change: Callable[[dict[str, Any]], Any]) -> Path:
    path = folder / "annotations.json"
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))
    return path


def test_validate_a_clean_set(punnet, folder: Path) -> None:
    result = punnet("data", "validate", folder)
    assert result.code == 0, result.err
    assert "no fault in 6 images and 12 annotations" in result.out


def test_validate_names_file_annotation_and_fault(punnet, folder: Path) -> None:
    damage(folder, lambda d: d["annotations"][0].update(bbox=[30, 20, 20, 20]))
    result = punnet("data", "validate", folder)
    assert result.code == 1
    assert "plant0-1.png, annotation 2: error: keypoint-outside-box: picking_point" in result.out
    assert "1 error and 0 warnings" in result.err
    data = json.loads(punnet("data", "validate", folder, "--json").out)
    assert data["by_code"] == {"keypoint-outside-box": 1}
    assert data["faults"][0]["annotation_id"] == 2


def test_fix_writes_a_new_file_and_reports_what_is_left(punnet, folder: Path, tmp_path: Path) -> None:
    def change(data: dict[str, Any]) -> None:
        data["annotations"][0].update(bbox=[30, 20, 20, 20])
        data["annotations"][1].update(category_id=9)

    path = damage(folder, change)
    before = path.read_bytes()
    out = tmp_path / "new" / "fixed.json"
    result = punnet("data", "validate", path, "--fix", "--out", out)
    assert result.code == 1
    assert "expanded the box" in result.out
    assert "unknown-class" in result.out
    assert path.read_bytes() == before
    fixed = json.loads(out.read_text())
    assert fixed["annotations"][0]["bbox"] == [30, 10, 20, 30]
    assert (out.parent / fixed["images"][0]["file_name"]).resolve() == folder.resolve() / "plant0-1.png"
    punnet("data", "validate", path, "--fix", "--out", out).fails_with("exists", "another name")
    punnet("data", "validate", path, "--fix", "--out", path).fails_with("exists")
    punnet("data", "validate", path, "--fix", "--out", tmp_path / "fixed").fails_with("ends in .json")
    assert path.read_bytes() == before
    assert punnet("data", "validate", path, "--fix").code == 2


def test_validate_other_formats_and_foreign_classes(punnet, folder: Path, tmp_path: Path) -> None:
    assert punnet("data", "convert", folder, "--out", tmp_path / "yolo", "--to", "yolo-segment").code == 0
    assert punnet("data", "validate", tmp_path / "yolo").code == 0
    damage(folder, lambda d: d["categories"][0].update(name="kiwi"))
    assert "foreign-class" in punnet("data", "validate", folder).out
    assert punnet("data", "validate", folder, "--class-map", "kiwi=pluckable").code == 0
    punnet("data", "validate", folder, "--class-map", "kiwi").fails_with("--class-map kiwi", "NAME=CLASS")


def test_stats_print_the_thesis_tables(punnet, folder: Path, tmp_path: Path) -> None:
    figure = tmp_path / "figure.svg"
    result = punnet("data", "stats", f"mine={folder}", "--figure", figure)
    assert result.code == 0, result.err
    for words in ("Table 3.1", "Table 3.2", "thesis: Dataset-2", "14279", "mine", "picking_point"):
        assert words in result.out
    assert figure.read_text().startswith("<?xml")
    punnet("data", "stats", folder, "--figure", figure).fails_with("exists")
    data = json.loads(punnet("data", "stats", folder, "--json").out)
    assert data["table_3_2"][0]["pluckable"] == 6
    assert data["sets"][0]["berries"] == 12
    punnet("data", "stats", folder, folder, "--figure", figure).fails_with("one path")
    punnet("data", "stats", tmp_path / "nothing").fails_with("nothing", "no such")


def test_split_keeps_plants_together(punnet, folder: Path, tmp_path: Path) -> None:
    shares = ("--train", "0.67", "--validation", "0", "--test", "0.33")
    result = punnet("data", "split", folder, "--out", tmp_path / "parts", *shares, "--pattern", r"plant\d")
    assert result.code == 0, result.err
    assert sorted(path.name for path in (tmp_path / "parts").glob("*.json") if path.name[0] != ".") == [
        "split.json",
        "test.json",
        "train.json",
    ]
    plants = []
    for part in ("train", "test"):
        dataset = read_dataset(tmp_path / "parts" / f"{part}.json")
        assert all(image.path.is_file() for image in dataset)
        plants.append({image.path.name[:6] for image in dataset})
    assert plants[0].isdisjoint(plants[1])
    again = punnet(
        "data", "split", folder, "--out", tmp_path / "again", "--list", tmp_path / "parts" / "split.json"
    )
    assert again.code == 0, again.err
    for part in ("train", "test"):
        assert (tmp_path / "again" / f"{part}.json").read_bytes() == (
            tmp_path / "parts" / f"{part}.json"
        ).read_bytes()
    punnet("data", "split", folder, "--out", tmp_path / "parts", *shares).fails_with("exists")


def test_split_says_what_it_does_not_know(punnet, folder: Path, tmp_path: Path) -> None:
    halves = ("--train", "0.5", "--validation", "0", "--test", "0.5")
    result = punnet("data", "split", folder, "--out", tmp_path / "parts", *halves)
    assert result.code == 0
    assert "each image is its own" in result.err
    lists = tmp_path / "lists.json"
    lists.write_text(json.dumps({"parts": {"train": ["plant0-1.png"], "test": ["plant0-2.png"]}}))
    damage(folder, lambda d: [image.update(group=image["file_name"][:6]) for image in d["images"]])
    result = punnet("data", "split", folder, "--out", tmp_path / "more", "--list", lists)
    assert result.code == 1
    assert "4 images are in no list" in result.err
    assert "more than one part, 'plant0'" in result.err
    punnet("data", "split", folder, "--out", tmp_path / "x", "--train", "0.5").fails_with("sum to 0.7")
    gone = ("--list", tmp_path / "gone.json")
    punnet("data", "split", folder, "--out", tmp_path / "x", *gone).fails_with("gone.json: no such file")


def test_view_writes_sheets(punnet, folder: Path, tmp_path: Path) -> None:
    layout = ("--columns", "2", "--rows", "2", "--cell", "80")
    result = punnet("data", "view", folder, "--out", tmp_path / "sheets", *layout, "--json")
    assert result.code == 0, result.err
    sheets = json.loads(result.out)["sheets"]
    assert sheets == ["sheet-001.png", "sheet-002.png"]
    assert all(cv2.imread(str(tmp_path / "sheets" / name)) is not None for name in sheets)
    assert punnet("data", "view", folder).code == 2
    assert punnet("data", "view", folder, "--serve", "--out", tmp_path / "x").code == 2
    damage(folder, lambda d: d["annotations"][0].update(bbox=[1]))
    result = punnet("data", "view", folder, "--out", tmp_path / "sheets", *layout, "--force")
    result.fails_with("annotation 2", "bad-box")
    assert "6 images on 2 sheets" in result.out


@pytest.mark.parametrize("name", ["sheet.png", "SHEET.JPG"])
def test_view_writes_one_sheet_as_the_picture_that_is_named(
    punnet, folder: Path, tmp_path: Path, name: str
) -> None:
    command = ("data", "view", folder, "--out", tmp_path / "new" / name, "--cell", "80", "--columns", "3")
    assert "6 images on 1 sheet;" in punnet(*command).out
    sheet = (tmp_path / "new" / name).read_bytes()
    assert sheet.startswith(b"\xff\xd8\xff" if name == "SHEET.JPG" else b"\x89PNG")
    assert cv2.imread(str(tmp_path / "new" / name)).shape[1] == 3 * 86 + 6
    punnet(*command).fails_with(name, "exists", "--force")
    assert punnet(*command, "--force").code == 0
    punnet(*command, "--rows", "1", "--force").fails_with("6 images take 2 sheets of 3", "give a folder")
    assert (tmp_path / "new" / name).read_bytes() == sheet


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_view_serves_until_it_is_stopped(folder: Path, number: int) -> None:
    # A background job of a shell ignores Ctrl-C, and so would what it starts.
    program = (
        "import signal as s; s.signal(s.SIGINT, s.default_int_handler); from punnet.cli import main; main()"
    )
    command = [sys.executable, "-c", program, "data", "view", str(folder), "--serve", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stderr is not None
            line = process.stdout.readline()
            address = line.split("//")[1].split("/")[0]
            connection = http.client.HTTPConnection(address, timeout=20)
            connection.request("GET", "/thumb/5.jpg")
            assert connection.getresponse().status == 200
            os.kill(process.pid, number)
            assert process.wait(20) == 0
            assert "stopped" in process.stderr.read()
        finally:
            process.kill()


def test_convert_leaves_out_what_is_damaged(punnet, folder: Path, tmp_path: Path) -> None:
    damage(folder, lambda d: d["annotations"][0].update(bbox=[1]))
    (folder / "plant2-6.png").unlink()
    out = tmp_path / "converted.json"
    result = punnet("data", "convert", folder, "--out", out)
    result.fails_with("annotation 2", "plant2-6.png", "2 images or annotations left out")
    dataset = read_dataset(out)
    assert len(dataset) == 5
    assert sum(len(image.annotations) for image in dataset) == 9
    assert punnet("data", "validate", out).code == 0
    punnet("data", "convert", folder, "--out", out).fails_with("exists", "--force")
    punnet("data", "convert", folder, "--out", tmp_path / "a.txt").fails_with("a.txt", "ends in .json")
    yolo = ("--to", "yolo-pose", "--out", tmp_path / "a.json")
    punnet("data", "convert", folder, *yolo).fails_with("called like a file, but a folder")
    assert punnet("data", "convert", folder, "--out", out, "--force", "--json").code == 1


def test_convert_to_yolo_says_what_is_lost(punnet, folder: Path, tmp_path: Path) -> None:
    result = punnet("data", "convert", folder, "--out", tmp_path / "yolo", "--to", "yolo-pose")
    assert result.code == 0, result.err
    assert "6 × weight" in result.err
    back = read_dataset(tmp_path / "yolo")
    assert len(back) == 6
    assert back[0].annotations[0].visibility is not None
    punnet(
        "data", "convert", folder, "--out", tmp_path / "x", "--to", "yolo-pose", "--format", "abc"
    ).fails_with("no data format 'abc'")


def test_a_split_is_kept_in_yolo(punnet, folder: Path, tmp_path: Path) -> None:
    assert (
        "no part val" in punnet("data", "convert", folder, "--out", tmp_path / "1", "--to", "yolo-pose").err
    )
    shares = ("--train", "0.5", "--validation", "0.5", "--test", "0")
    assert punnet("data", "split", folder, "--out", tmp_path / "parts", *shares).code == 0
    lists = tmp_path / "parts" / "split.json"
    command = ("data", "convert", folder, "--list", lists, "--out")
    result = punnet(*command, tmp_path / "2", "--to", "yolo-pose")
    assert result.code == 0, result.err
    assert "no part val" not in result.err
    counts = {part: len([*(tmp_path / "2" / "labels" / part).iterdir()]) for part in ("train", "val")}
    assert counts == {"train": 3, "val": 3}
    lists.write_text('{"parts": {"train": ["plant0-1.png"]}}')
    result = punnet(*command, tmp_path / "3", "--to", "yolo-pose", "--json")
    assert json.loads(result.out)["images"] == 1
    assert "5 images are in no list" in result.err
    lists.write_text('{"parts": {"best": ["plant0-1.png"]}}')
    punnet(*command, tmp_path / "4", "--to", "yolo-pose").fails_with("train, val, test", "best")
    punnet(*command, tmp_path / "4.json").fails_with("--list is for YOLO")


def test_nothing_of_use_is_said(punnet, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("not labels")
    for command in (
        ("convert", "--out", tmp_path / "o.json"),
        ("view", "--serve"),
        ("split", "--out", tmp_path / "o"),
    ):
        punnet("data", command[0], tmp_path / "notes.txt", *command[1:]).fails_with("notes.txt", "format")
    punnet("data", "validate", tmp_path / "notes.txt").fails_with("notes.txt")
