"""Whatever lies in a file, a reader gives demonstrations, faults, or an error that says what is wrong."""

from __future__ import annotations

import contextlib
import copy
import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from punnet.data.demos import (
    DEMO_FORMATS,
    DemonstrationSet,
    read_readable_demos,
    write_lerobot,
    write_punnet_folder,
)
from punnet.data.demos.validation import check_demonstrations
from punnet.errors import PunnetError
from tests.data.demos.conftest import berries_on_a_wall
from tests.data.demos.recordings import record
from tests.data.demos.test_reach import entry
from tests.data.demos.test_thesis_zip import joint
from tests.data.demos.test_thesis_zip import write as write_zip

LAB = {
    "joint_position": [[0.0, 0.1], [0.1, 0.2], [0.2, 0.2]],
    "time": [0.0, 0.1, 0.2],
    "pose": [[0.3, 0, 0.7, 0, 0, 0, 1.0]] * 3,
    "box": [1, 1, 4, 4],
    "target": "a",
    "configuration": 2,
}
FUZZ = settings(
    deadline=None, max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture], database=None
)
numbers = st.one_of(
    st.integers(-3, 9), st.integers(), st.floats(), st.sampled_from([1e308, 2**70, -1, 1e-320])
)
words = st.one_of(st.text(max_size=5), st.sampled_from(["", "../a", "rgb", "phase", "\0"]))
values = st.recursive(
    st.one_of(st.none(), st.booleans(), numbers, words),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(words, inner, max_size=3)),
    max_leaves=6,
)


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, str]]:
    """Path that is read and file in it that is damaged, by format and part."""
    folder = tmp_path_factory.mktemp("sources")
    wall = berries_on_a_wall(folder, np.random.default_rng(0), scenes=1, targets=1)
    small = DemonstrationSet(tuple(replace(episode, photographs=()) for episode in wall))
    write_punnet_folder(wall, folder / "punnet")
    write_lerobot(small, folder / "lerobot", fps=10)
    (folder / "lab.json").write_text(json.dumps(LAB))
    reach = folder / "reach"
    (reach / "img").mkdir(parents=True)
    shutil.copyfile(folder / "scene0.png", reach / "img" / "a.png")
    (reach / "index.json").write_text(
        json.dumps([entry("0", bbox_xywh=[1, 1, 9, 9]), entry("1", bbox_xywh=[1, 1, 9, 9])])
    )
    task = np.ones((2, 7, 8))
    np.savez(
        reach / "promp_weights.npz",
        ids=np.array(["0", "1"]),
        joint_mean=task,
        task_mean=task,
        joint_cov_eig=np.ones((2, 7, 9)),
        task_cov_eig=np.ones((2, 7, 9)),
    )
    zipped = write_zip(folder / "annotation.zip", {"0": [joint()] * 7})
    bag, mcap = record(folder, "rosbag1", "one"), record(folder, "mcap", "two")
    chunk = "chunk-000/file-000.parquet"
    return {
        "punnet": (folder / "punnet", "demonstrations.json"),
        "punnet-npz": (folder / "punnet", "trajectories.npz"),
        "lerobot": (folder / "lerobot", "meta/info.json"),
        "lerobot-own": (folder / "lerobot", "meta/punnet.json"),
        "lerobot-data": (folder / "lerobot", f"data/{chunk}"),
        "lerobot-episodes": (folder / "lerobot", f"meta/episodes/{chunk}"),
        "lab-json": (folder / "lab.json", ""),
        "reach": (reach, "index.json"),
        "reach-npz": (reach, "promp_weights.npz"),
        "thesis": (zipped, ""),
        "bag": (bag, ""),
        "bag-mcap": (mcap, ""),
    }  # fmt: skip


JSON_PARTS = ("punnet", "lerobot", "lerobot-own", "lab-json", "reach")
PARTS = (
    *JSON_PARTS,
    "punnet-npz",
    "lerobot-data",
    "lerobot-episodes",
    "reach-npz",
    "thesis",
    "bag",
    "bag-mcap",
)


def test_every_format_is_fuzzed() -> None:
    assert {name for part in PARTS for name in DEMO_FORMATS if part.startswith(name)} == set(DEMO_FORMATS)


def format_of(part: str) -> str:
    return next(name for name in DEMO_FORMATS if part.startswith(name))


@contextlib.contextmanager
def damaged(source: tuple[Path, str], content: bytes) -> Iterator[Path]:
    """The path while the file holds something else."""
    path, inside = source
    file = path / inside if inside else path
    before = file.read_bytes()
    file.write_bytes(content)
    try:
        yield path
    finally:
        file.write_bytes(before)


def use(path: Path, kind: str) -> int:
    """Read and check; only errors made on purpose may come of it."""
    with contextlib.suppress(PunnetError):
        reading = read_readable_demos(path, kind)
        check_demonstrations(reading.demonstrations())
        return len(reading.episodes)
    return 0


@pytest.mark.parametrize("part", PARTS)
def test_what_is_fuzzed_is_sound(sources: dict[str, tuple[Path, str]], part: str) -> None:
    assert use(sources[part][0], format_of(part)) > 0


def places(value: Any, here: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield here
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in inside:
        yield from places(inner, (*here, key))


@pytest.mark.parametrize("part", JSON_PARTS)
@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")
@FUZZ
@given(data=st.data())
def test_json_with_a_part_replaced_or_missing(
    sources: dict[str, tuple[Path, str]], part: str, data: st.DataObject
) -> None:
    path, inside = sources[part]
    whole = {"": json.loads((path / inside if inside else path).read_text())}
    changed = copy.deepcopy(whole)
    for _ in range(data.draw(st.integers(1, 2), label="changes")):
        way = data.draw(st.sampled_from([way for way in places(changed) if way]), label="place")
        holder: Any = changed
        for key in way[:-1]:
            holder = holder[key]
        if data.draw(st.booleans(), label="left out") and len(way) > 1:
            holder.pop(way[-1])
        else:
            holder[way[-1]] = data.draw(values, label="value")
    with damaged(sources[part], json.dumps(changed[""]).encode()):
        use(path, format_of(part))


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")
@FUZZ
@given(data=st.data())
def test_bytes_cut_off_or_overwritten(
    sources: dict[str, tuple[Path, str]], part: str, data: st.DataObject
) -> None:
    path, inside = sources[part]
    content = (path / inside if inside else path).read_bytes()
    begin = data.draw(st.integers(0, len(content)), label="begin")
    end = data.draw(st.one_of(st.just(len(content)), st.just(min(begin + 4, len(content)))), label="end")
    piece = data.draw(
        st.one_of(st.just(b""), st.binary(max_size=6), st.just(b"\xff\xff\xff\x7f")), label="piece"
    )
    with damaged(sources[part], content[:begin] + piece + content[end:]):
        use(path, format_of(part))


@FUZZ
@given(
    content=st.binary(max_size=120),
    name=st.sampled_from(["x.json", "x.zip", "x.bag", "x.mcap", "x.db3", "x"]),
)
def test_anything_at_all_is_guessed_or_refused(tmp_path: Path, content: bytes, name: str) -> None:
    (tmp_path / name).write_bytes(content)
    try:
        told = " ".join(map(str, read_readable_demos(tmp_path / name).left_out))
    except PunnetError as error:
        told = str(error)
    assert name in told
