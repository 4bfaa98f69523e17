"""``punnet evaluate detector`` and ``punnet reproduce``: what they print, write, and say about bad input."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from punnet.data.coco import write_coco
from punnet.data.dataset import AnnotatedImage, Annotation, Dataset
from punnet.perception import ColourDetector
from punnet.scene import Frame
from tests.perception.drawings import gravel, hang_berry
from tests.perception.toy_detector import write_toy_bundle

Punnet = Callable[..., Any]


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three drawn photographs with a ripe berry each, annotated as the colour baseline sees them."""
    folder = tmp_path_factory.mktemp("drawn")
    images = []
    for number in (1, 2, 3):
        picture = gravel(240, 320, seed=number)
        mask = hang_berry(picture, (80 * number, 130))
        path = folder / f"{number}.png"
        cv2.imwrite(str(path), picture[:, :, ::-1])
        seen = ColourDetector().detect(Frame(rgb=picture))
        assert seen.keypoints is not None
        outline, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        berry = Annotation(
            id=number,
            class_index=0,
            box=seen.boxes[0],
            segmentation=[max(outline, key=len).reshape(-1).astype(float).tolist()],
            keypoints=seen.keypoints[0],
            visibility=seen.visibility[0] if seen.visibility is not None else None,
        )
        images.append(AnnotatedImage(number, path, 320, 240, (berry,)))
    write_coco(Dataset(tuple(images), name="drawn"), folder / "annotations.json")
    return folder


def test_tables_and_folder(punnet: Punnet, drawn: Path, tmp_path: Path) -> None:
    out = tmp_path / "scores"
    result = punnet("evaluate", "detector", "--detector", "colour", "--data", drawn, "--out", out)
    assert result.code == 0, result.err
    for words in ("mask 0.5", "key-point 0.1", "pluckable", "picking point", "ms an image", f"see {out}"):
        assert words in result.out
    data = json.loads((out / "evaluation.json").read_text())
    assert data["classes"][0]["mask_ap"]["0.7"] == pytest.approx(1)
    assert data["classes"][0]["keypoint_ap"]["0.5"] == pytest.approx(1)
    assert data["latency"]["median_seconds"] > 0
    assert (out / "scores.png").is_file()
    again = punnet("evaluate", "detector", "--detector", "colour", "--data", drawn, "--out", out)
    again.fails_with("exists", "--force")


def test_json_of_a_bundle_and_a_split(punnet: Punnet, drawn: Path, tmp_path: Path) -> None:
    bundle = write_toy_bundle(tmp_path / "toy")
    names = tmp_path / "names.json"
    names.write_text(json.dumps(["3.png", "1.png"]))
    result = punnet("evaluate", "detector", "--bundle", bundle, "--data", drawn, "--split", names, "--json")
    assert result.code == 0, result.err
    data = json.loads(result.out)
    assert (data["images"], data["split"]) == (2, str(names))
    # The toy calls the box around all that is red a berry, with a mask of an ellipse.
    assert data["classes"][0]["mask_ap"]["0.5"] == pytest.approx(1)
    assert data["class_confusion"]["counts"][0] == [2, 0, 0]
    assert data["user_score"] == 0.5
    limited = punnet("evaluate", "detector", "--bundle", bundle, "--data", drawn, "--limit", 1, "--json")
    assert json.loads(limited.out)["images"] == 1


def test_a_damaged_photograph_is_left_out_and_said(punnet: Punnet, drawn: Path, tmp_path: Path) -> None:
    folder = tmp_path / "copy"
    folder.mkdir()
    for name in ("annotations.json", "1.png", "2.png"):
        (folder / name).write_bytes((drawn / name).read_bytes())
    (folder / "3.png").write_bytes(b"\x89PNG")
    result = punnet("evaluate", "detector", "--detector", "colour", "--data", folder, "--json")
    result.fails_with("3.png", "1 of 3 images left out")
    data = json.loads(result.out)
    assert (data["images"], len(data["skipped"])) == (2, 1)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--split", "absent.json"), ("absent.json", "no such file")),
        (("--split", "test"), ("fixed split of StrawDI", "not in")),
        (("--format", "cuneiform"), ("cuneiform",)),
        (("--bundle", "no-such-model"), ("no-such-model",)),
    ],
)
def test_bad_options_are_told(
    punnet: Punnet, drawn: Path, options: tuple[str, ...], words: tuple[str, ...]
) -> None:
    bundle = () if "--bundle" in options else ("--bundle", "colour")
    punnet("evaluate", "detector", *bundle, "--data", drawn, *options).fails_with(*words)


@pytest.mark.parametrize("text", ["{", "[]", '{"parts": {"train": ["1.png"]}}', "[true]", '["9.png"]'])
def test_bad_splits_are_told(punnet: Punnet, drawn: Path, tmp_path: Path, text: str) -> None:
    path = tmp_path / "list.json"
    path.write_text(text)
    result = punnet("evaluate", "detector", "--bundle", "colour", "--data", drawn, "--split", path)
    result.fails_with("list.json")


def test_tables_of_data_sets(punnet: Punnet, drawn: Path) -> None:
    result = punnet("reproduce", "table-3-1", "--data", f"ours={drawn}", "--json")
    rows = {row["data set"]: row for row in json.loads(result.out)["rows"]}
    assert (rows["images"]["ours"], rows["images"]["thesis: Dataset-1"]) == (3, 1588)
    assert (rows["segmentation"]["ours"], rows["depth"]["ours"], rows["farm"]["ours"]) == (True, False, None)
    result = punnet("reproduce", "table-3-2", "--data", f"ours={drawn}", "--data", f"same={drawn}")
    lines = result.out.splitlines()
    assert lines[2] == "| ours | 3 | 3 | 0 | 3 | – |"
    assert lines[3].startswith("| same |")
    assert lines[-1] == "| thesis: Dataset-2 | 3100 | 3659 | 14279 | 10999 | – |"


def test_table_of_scores_from_files_and_from_a_run(punnet: Punnet, drawn: Path, tmp_path: Path) -> None:
    out = tmp_path / "scores.json"
    out.write_text(punnet("evaluate", "detector", "--bundle", "colour", "--data", drawn, "--json").out)
    result = punnet("reproduce", "table-3-3", f"earlier={out}", "--row", f"now=colour:{drawn}")
    assert result.code == 0, result.err
    lines = result.out.splitlines()
    assert len({line.count("|") for line in lines}) == 1
    earlier, now = (line.split(" | ", 1) for line in lines[2:4])
    assert (earlier[0], now[0]) == ("| earlier", "| now")
    assert earlier[1] == now[1]
    # Nothing unpluckable is annotated.
    assert lines[2] == ("| earlier | 3 | 100.0 / 100.0 / 0.0 | – | 100.0 / 100.0 / 100.0 | – |")
    assert "| thesis: X101, Dataset-1 | – | 94.2 / 92.8 / 88.7 | 61.1 / 56.2 / 45.6 |" in result.out
    rows = json.loads(punnet("reproduce", "table-3-3", "--json").out)["rows"]
    assert len(rows) == 4
    assert rows[0]["masks pluckable, IoU .5 / .7 / .9"] == [93.3, 91.0, 83.6]


def test_rows_that_make_no_sense_are_told(punnet: Punnet, drawn: Path, tmp_path: Path) -> None:
    punnet("reproduce", "table-3-3", "--row", "colour").fails_with("BUNDLE:DATA")
    punnet("reproduce", "table-3-3", tmp_path / "absent.json").fails_with("absent.json", "no such file")
    out = tmp_path / "scores.json"
    out.write_text(
        punnet("evaluate", "detector", "--bundle", "colour", "--data", drawn, "--limit", 1, "--json").out
    )
    punnet("reproduce", "table-3-3", f"a={out}", f"a={out}").fails_with("two rows are called 'a'")


def test_colour_baseline_on_strawdi(punnet: Punnet, shared_data: Path) -> None:
    result = punnet(
        "evaluate", "detector", "--bundle", "colour", "--data", shared_data / "strawdi" / "test", "--split", "test",
        "--limit", 5, "--json",
    )  # fmt: skip
    assert result.code == 0, result.err
    data = json.loads(result.out)
    assert data["images"] == 5
    assert data["classes"][1]["truths"] > 5
    assert data["classes"][2]["mask_ap"]["0.5"] > 0.2
    assert data["visibility"]["accuracy"] > 0.3
