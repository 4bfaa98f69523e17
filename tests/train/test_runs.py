"""A run has a folder of its own, which is refused before the work if it can't be."""

from __future__ import annotations

from pathlib import Path

import pytest

from punnet.errors import FileFormatError, OutputError, OutputExistsError
from punnet.train.runs import claim_run, read_object, require_run_place


def test_a_run_is_claimed_for_its_settings(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "run"
    for _ in range(2):
        claim_run(folder, "run.json", {"seed": 3}, what="run")
    assert read_object(folder / "run.json") == {"seed": 3}
    require_run_place(folder, "run.json", what="run")
    with pytest.raises(OutputExistsError, match="other seed"):
        claim_run(folder, "run.json", {"seed": 4}, what="run")


@pytest.mark.parametrize(
    ("name", "said"),
    [("thesis.tex", "a file stands"), ("", "holds no run"), ("run.json", "called like a file")],
)
def test_other_places_are_refused(tmp_path: Path, name: str, said: str) -> None:
    (tmp_path / "thesis.tex").write_text("three years of work")
    with pytest.raises(OutputError, match=said):
        require_run_place(tmp_path / name, "config.json", what="run")
    with pytest.raises(OutputError, match=said):
        claim_run(tmp_path / name, "config.json", {"seed": 3}, what="run")
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_what_is_no_object_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"gone\.json: no such file"):
        read_object(tmp_path / "gone.json")
    with pytest.raises(FileFormatError, match="no such file"):
        read_object(Path(__file__) / "run.json")
    for content, said in (("[1]", "object is needed"), ("{broken", "not readable as JSON")):
        (tmp_path / "run.json").write_text(content)
        with pytest.raises(FileFormatError, match=said):
            read_object(tmp_path / "run.json")
