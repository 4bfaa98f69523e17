"""A folder that grows goes on with its own settings only, and nothing of anybody else's is lost."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from punnet.errors import FileFormatError, OutputError, OutputExistsError
from punnet.outputs import MARKER_FILE
from punnet.sim.growing_folder import PICTURES_AND_SHARDS, finish_folder, open_folder, shard_path

BEGUN = {"schema": "plants/1", "command": "grow --seed 3", "seed": 3, "images": 8}


def begin(place: Path, begun: dict[str, Any] | None = None, *, force: bool = False) -> None:
    open_folder(
        place, "plants.json", begun or BEGUN, what="row of plants", parts=PICTURES_AND_SHARDS, force=force
    )


def test_it_is_begun_and_gone_on_with(tmp_path: Path) -> None:
    place = tmp_path / "deep" / "row"
    begin(place)
    assert json.loads((place / "plants.json").read_text()) == BEGUN
    assert json.loads((place / MARKER_FILE).read_text())["complete"] is False
    shard_path(place, 2).write_text("[]")
    begin(place)
    assert shard_path(place, 2).is_file()
    begin(place, force=True)
    assert not shard_path(place, 2).exists()


def test_other_settings_are_named_and_the_command_only_if_it_alone_differs(tmp_path: Path) -> None:
    begin(tmp_path / "row")
    other = {**BEGUN, "command": "grow --seed 4", "seed": 4, "protocol": "night"}
    with pytest.raises(OutputExistsError) as told:
        begin(tmp_path / "row", other)
    assert "was begun with seed 3, protocol 'not given'; go on with the same" in str(told.value)
    with pytest.raises(OutputExistsError, match="begun with command 'grow --seed 3'"):
        begin(tmp_path / "row", {**BEGUN, "command": "grow"})
    begin(tmp_path / "row", other, force=True)
    assert json.loads((tmp_path / "row" / "plants.json").read_text()) == other


def test_settings_may_have_a_key_of_their_own(tmp_path: Path) -> None:
    def begin_under(seed: int) -> None:
        begun = {"schema": "plants/1", "info": {"seed": seed}, "episodes": []}
        open_folder(tmp_path / "row", "row.json", begun, what="row", parts=["rgb"], force=False, under="info")

    begin_under(3)
    begin_under(3)
    with pytest.raises(OutputExistsError, match="begun with seed 3;"):
        begin_under(4)
    (tmp_path / "row" / "row.json").write_text('{"schema": "plants/1", "info": null}')
    with pytest.raises(OutputExistsError, match="seed 'not given'"):
        begin_under(3)


def test_a_complete_one_stands_unless_forced(tmp_path: Path) -> None:
    place = tmp_path / "row"
    begin(place)
    (place / "rgb" / ".half.jpg-x").write_bytes(b"half")
    finish_folder(place)
    assert json.loads((place / MARKER_FILE).read_text())["complete"] is True
    assert {path.name for path in place.iterdir()} == {"rgb", "depth", "plants.json", MARKER_FILE}
    assert not list((place / "rgb").iterdir())
    (place / "plants.json").write_text(json.dumps({**BEGUN, "complete": True}))
    with pytest.raises(OutputExistsError, match=r"is complete.*--force"):
        begin(place)
    begin(place, force=True)
    assert json.loads((place / "plants.json").read_text()) == BEGUN


@pytest.mark.parametrize("force", [False, True])
def test_what_is_not_ours_is_left_alone(tmp_path: Path, force: bool) -> None:
    (tmp_path / "thesis.txt").write_text("the only copy")
    with pytest.raises(OutputExistsError, match="is no row of plants"):
        begin(tmp_path, force=force)
    for place in (tmp_path / "thesis.txt", tmp_path / "thesis.txt" / "row"):
        with pytest.raises(OutputError, match="a file stands where a folder is needed"):
            begin(place, force=force)
    for content in ("{broken", "[]", '{"schema": "plants/2"}'):
        (tmp_path / "plants.json").write_text(content)
        with pytest.raises(FileFormatError, match=r"plants\.json"):
            begin(tmp_path, force=force)
        assert (tmp_path / "plants.json").read_text() == content
    assert (tmp_path / "thesis.txt").read_text() == "the only copy"
