"""The factory: the same bytes however it is run, and nothing lost or overwritten."""

import hashlib
import json
import sys

import numpy as np
import pytest

from punnet.errors import ConfigurationError, FileFormatError, OutputError, OutputExistsError
from punnet.scene import Frame
from punnet.sim import dataset_factory
from punnet.sim.dataset_factory import simulate_dataset


def digest(folder):
    """Every file's name and content."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("factory") / "set"
    seen = []
    report = simulate_dataset(folder, images=4, seed=11, progress=seen.append)
    return folder, report, seen


def test_it_makes_what_was_asked_for(made):
    folder, report, seen = made
    data = json.loads((folder / "annotations.json").read_text())
    assert report.images == len(data["images"]) == 4
    assert (report.made, report.kept, report.plants) == (4, 0, 2)
    assert seen[0] == 0
    assert seen[-1] == 4
    assert [image["id"] for image in data["images"]] == list(range(1, 5))
    assert [image["view"] for image in data["images"][:3]] == ["far", "middle", "near"]
    assert {image["group"] for image in data["images"]} == {f"plant-11-{n}" for n in range(2)}
    assert len({a["id"] for a in data["annotations"]}) == len(data["annotations"]) == report.annotations
    assert {a["image_id"] for a in data["annotations"]} <= {image["id"] for image in data["images"]}
    assert all((a["category_id"] == 1) == (a["stage"] == "ripe") for a in data["annotations"])
    assert not (folder / ".plants").exists()
    assert json.loads((folder / "data.json").read_text())["complete"] is True


def test_its_files_are_frames(made):
    folder, _, _ = made
    for image in json.loads((folder / "annotations.json").read_text())["images"]:
        frame = Frame.from_files(
            folder / image["file_name"], depth=folder / image["depth_path"], camera=folder / "camera.json"
        )
        assert (frame.width, frame.height) == (image["width"], image["height"])
        assert 0.1 < np.median(frame.depth[frame.depth > 0]) < 10.0


def test_a_berry_keeps_its_number_and_its_weight_in_all_views(made):
    folder, _, _ = made
    data = json.loads((folder / "annotations.json").read_text())
    group = {image["id"]: image["group"] for image in data["images"]}
    weights = {}
    for annotation in data["annotations"]:
        key = group[annotation["image_id"]], annotation["berry_id"]
        assert weights.setdefault(key, annotation["weight_g"]) == annotation["weight_g"]
    assert len(weights) < len(data["annotations"])


def test_two_workers_make_the_same_bytes(made, tmp_path):
    folder, _, _ = made
    simulate_dataset(tmp_path / "two", images=4, seed=11, workers=2)
    assert digest(tmp_path / "two") == digest(folder)


def test_an_interrupted_run_goes_on_and_ends_in_the_same_bytes(made, tmp_path, monkeypatch):
    folder, _, _ = made
    make = dataset_factory._make_plant
    calls = []

    def interrupted(place, seed, protocol, plant, views):
        calls.append(plant)
        if len(calls) == 2:
            (tmp_path / "set" / "rgb" / ".000001-far.jpg.1").write_bytes(b"half")
            raise KeyboardInterrupt
        return make(place, seed, protocol, plant, views)

    monkeypatch.setattr(dataset_factory, "_make_plant", interrupted)
    with pytest.raises(KeyboardInterrupt):
        simulate_dataset(tmp_path / "set", images=4, seed=11)
    assert not (tmp_path / "set" / "annotations.json").exists()
    with pytest.raises(OutputExistsError, match="seed 11"):
        simulate_dataset(tmp_path / "set", images=4, seed=12)
    report = simulate_dataset(tmp_path / "set", images=4, seed=11)
    assert (report.made, report.kept) == (1, 3)
    assert calls == [0, 1, 1]
    assert digest(tmp_path / "set") == digest(folder)


def test_dataset_1_is_a_set_of_its_own_that_only_itself_goes_on_with(made, tmp_path):
    folder, _, _ = made
    report = simulate_dataset(tmp_path / "first", images=3, seed=11, protocol="dataset-1")
    assert report.images == 3
    data = json.loads((tmp_path / "first" / "annotations.json").read_text())
    assert {image["group"] for image in data["images"]} == {"set-11-0"}
    assert data["info"]["protocol"] == "dataset-1"
    assert any(annotation["category_id"] == 1 for annotation in data["annotations"])
    others = {a["weight_g"] for a in json.loads((folder / "annotations.json").read_text())["annotations"]}
    assert not others & {annotation["weight_g"] for annotation in data["annotations"]}
    unfinished = json.loads((tmp_path / "first" / "data.json").read_text()) | {"complete": False}
    (tmp_path / "first" / "data.json").write_text(json.dumps(unfinished))
    with pytest.raises(OutputExistsError, match="protocol 'dataset-1'"):
        simulate_dataset(tmp_path / "first", images=3, seed=11)


def test_a_complete_set_is_not_made_again_unless_forced(made, monkeypatch):
    folder, _, _ = made
    before = digest(folder)
    with pytest.raises(OutputExistsError, match="--force"):
        simulate_dataset(folder, images=4, seed=11)
    assert digest(folder) == before
    simulate_dataset(folder, images=4, seed=11, force=True)
    assert digest(folder) == before


def test_a_foreign_folder_is_left_alone_even_when_forced(tmp_path):
    (tmp_path / "mine.txt").write_text("keep")
    for force in (False, True):
        with pytest.raises(OutputExistsError, match="no simulated data set"):
            simulate_dataset(tmp_path, images=3, seed=0, force=force)
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="a file stands"):
        simulate_dataset(tmp_path / "file", images=3, seed=0)
    other = tmp_path / "other"
    other.mkdir()
    (other / "data.json").write_text("{broken")
    with pytest.raises(FileFormatError, match=r"data\.json"):
        simulate_dataset(other, images=3, seed=0, force=True)
    assert (tmp_path / "mine.txt").read_text() == "keep"
    assert (other / "data.json").read_text() == "{broken"


@pytest.mark.parametrize(
    "settings",
    [{"images": 0}, {"workers": 0}, {"seed": -1}, {"backend": "threads"}, {"protocol": "dataset-9"}],
    ids=str,
)
def test_bad_settings_are_named(tmp_path, settings):
    with pytest.raises(ConfigurationError, match="simulate"):
        simulate_dataset(tmp_path / "set", **({"images": 3, "seed": 0} | settings))
    assert not (tmp_path / "set").exists()


def test_ray_is_asked_for_by_name_where_it_is_missing(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.setitem(sys.modules, "ray.util.joblib", None)
    with pytest.raises(ConfigurationError, match="punnet\\[scale\\]"):
        simulate_dataset(tmp_path / "set", images=3, seed=0, backend="ray")
    assert not (tmp_path / "set").exists()
