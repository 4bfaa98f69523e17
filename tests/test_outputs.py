"""Output folders: complete or not there, and nothing of anybody else's is lost."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from punnet.errors import OutputError, OutputExistsError
from punnet.outputs import FIGURES, MARKER_FILE, Interrupted, OutputFolder, require_suffix


def contents(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()} - {MARKER_FILE}


def complete(folder: Path) -> bool:
    return bool(json.loads((folder / MARKER_FILE).read_text())["complete"])


def write(folder: Path, name: str, *, force: bool = False) -> None:
    with OutputFolder(folder, force=force) as output:
        (output.path / name).write_text("x")


def break_off(folder: Path, error: BaseException, *, pieces: int) -> None:
    with OutputFolder(folder, force=True) as output:
        (output.path / "half").write_text("x")
        for _ in range(pieces):
            output.finished()
        raise error


def test_appears_only_when_complete(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    with OutputFolder(folder) as output:
        (output.path / "x").write_text("x")
        assert not folder.exists()
    assert contents(folder) == {"x"}
    assert complete(folder)
    assert contents(tmp_path / "a") == {"b"}
    with pytest.raises(OutputError, match="not open"):
        _ = output.path


def test_force_replaces_only_what_punnet_made_or_what_is_empty(tmp_path: Path) -> None:
    write(tmp_path / "out", "old")
    with pytest.raises(OutputExistsError, match="--force"):
        write(tmp_path / "out", "new")
    write(tmp_path / "out", "new", force=True)
    assert contents(tmp_path / "out") == {"new"}
    (tmp_path / "empty").mkdir()
    write(tmp_path / "empty", "new", force=True)
    assert contents(tmp_path / "empty") == {"new"}
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "thesis").write_text("x")
    (tmp_path / "file").write_text("x")
    for name in ("theirs", "file"):
        with pytest.raises(OutputExistsError, match="not made by punnet"):
            write(tmp_path / name, "new", force=True)
    assert contents(tmp_path) == {"out", "empty", "theirs", "file"}


def test_a_file_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for place in ("file/out", "file/deep/out"):
        with pytest.raises(OutputError, match="file stands where a folder"):
            write(tmp_path / place, "x")


def test_a_file_is_called_what_it_is() -> None:
    for name in ("a.svg", "b/A.PNG"):
        require_suffix(name, *FIGURES)
    for name in ("a.txt", "png", "a.svg.gz"):
        with pytest.raises(OutputError, match=r"ends in \.png or \.svg or \.pdf"):
            require_suffix(name, *FIGURES)


@pytest.mark.parametrize("name", ["overlay.png", "SCORES.JSON"])
def test_a_folder_is_not_called_like_a_file(tmp_path: Path, name: str) -> None:
    with pytest.raises(OutputError, match=r"called like a file.*leave"):
        write(tmp_path / name, "x")
    assert contents(tmp_path) == set()
    write(tmp_path / "run.2", "x")
    (tmp_path / name).mkdir()  # who has such a folder may keep it
    write(tmp_path / name, "x", force=True)
    assert contents(tmp_path / name) == {"x"}


def test_an_error_without_pieces_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError):
        break_off(tmp_path / "out", ZeroDivisionError(), pieces=0)
    assert contents(tmp_path) == set()


def test_an_error_keeps_finished_pieces_and_says_where(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError) as caught:
        break_off(tmp_path / "out", ZeroDivisionError(), pieces=1)
    assert contents(tmp_path / "out") == {"half"}
    assert not complete(tmp_path / "out")
    assert caught.value.__notes__ == [f"kept what was finished in {tmp_path / 'out'}"]


def test_interrupt_names_what_was_kept(tmp_path: Path) -> None:
    with pytest.raises(Interrupted) as caught:
        break_off(tmp_path / "out", KeyboardInterrupt(), pieces=1)
    assert caught.value.kept == tmp_path / "out"
    with pytest.raises(Interrupted) as caught:
        break_off(tmp_path / "other", KeyboardInterrupt(), pieces=0)
    assert caught.value.kept is None


def test_partial_results_never_replace_complete_ones(tmp_path: Path) -> None:
    write(tmp_path / "out", "whole")
    for _ in range(2):
        with pytest.raises(Interrupted) as caught:
            break_off(tmp_path / "out", KeyboardInterrupt(), pieces=1)
        assert caught.value.kept == tmp_path / "out-partial"
    assert contents(tmp_path / "out") == {"whole"}
    assert contents(tmp_path / "out-partial") == {"half"}
    (tmp_path / "out-partial" / MARKER_FILE).unlink()
    with pytest.raises(Interrupted) as caught:
        break_off(tmp_path / "out", KeyboardInterrupt(), pieces=1)
    assert caught.value.kept is None
    assert contents(tmp_path / "out-partial") == {"half"}
