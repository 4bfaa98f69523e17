"""A log that only grows, and files that are whole: what a kill, a full disk and a second writer make of them."""

import errno
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from punnet.errors import FileFormatError, OutputError
from punnet.harvest.durable import AppendOnlyLog, read_lines, write_durably

WRITER = """
import sys
from pathlib import Path
from punnet.harvest.durable import AppendOnlyLog
with AppendOnlyLog(Path(sys.argv[1])) as log:
    print("go", flush=True)
    while True:
        log.append("counted", text="ü" * 500)
"""


def full_disk(*arguments):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_records_come_back_in_order(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    with AppendOnlyLog(path) as log:
        log.append("one", berries=3)
    with AppendOnlyLog(path) as log:
        assert log.append("two")["n"] == 1
    assert read_lines(path)[0] == [{"n": 0, "kind": "one", "berries": 3}, {"n": 1, "kind": "two"}]


@given(cut=st.integers(0, 400))
def test_wherever_a_line_is_torn_the_ones_before_it_stay(tmp_path_factory, cut: int) -> None:
    path = tmp_path_factory.mktemp("log") / "log.jsonl"
    with AppendOnlyLog(path) as log:
        for number in range(8):
            log.append("counted", number=number, name="Erdbeere, süß")
    content = path.read_bytes()
    path.write_bytes(content[:cut])
    whole = content[:cut].count(b"\n")
    with AppendOnlyLog(path) as log:
        assert [record["number"] for record in log.records] == list(range(whole))
        log.append("counted", number=whole)
    assert [record["number"] for record in read_lines(path)[0]] == list(range(whole + 1))


@pytest.mark.parametrize(
    "damage", [b'{"n": 0}\nrubbish\n{"n": 2}\n', b'{"n": 0}\n{"n": 2}\n{"n": 3}\n', b"[]\n[]\n"]
)
def test_damage_that_no_kill_makes_is_named(tmp_path: Path, damage: bytes) -> None:
    path = tmp_path / "log.jsonl"
    path.write_bytes(damage)
    with pytest.raises(FileFormatError, match=r"log.jsonl: line \d is damaged"):
        AppendOnlyLog(path)
    assert path.read_bytes() == damage


def test_a_killed_writer_leaves_whole_lines(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    seen = 0
    for _ in range(3):
        process = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE)
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(0.05)
        process.kill()
        process.communicate()
        with AppendOnlyLog(path) as log:
            assert len(log.records) > seen
            seen = len(log.records)


def test_one_process_at_a_time(tmp_path: Path) -> None:
    with AppendOnlyLog(tmp_path / "log.jsonl"), pytest.raises(OutputError, match="another process"):
        AppendOnlyLog(tmp_path / "log.jsonl")
    AppendOnlyLog(tmp_path / "log.jsonl").close()


def test_a_full_disk_leaves_the_log_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "log.jsonl"
    write = os.write

    def half_of_it(file: int, content: bytes) -> int:
        if len(content) < 20:
            full_disk()
        return write(file, content[: len(content) // 2])

    with AppendOnlyLog(path) as log:
        log.append("one")
        monkeypatch.setattr(os, "write", half_of_it)
        with pytest.raises(OutputError, match=r"log.jsonl: can't be written \(No space left"):
            log.append("two", text="x" * 100)
        monkeypatch.undo()
        log.append("three")
    assert [record["kind"] for record in read_lines(path)[0]] == ["one", "three"]


def test_a_file_is_the_old_or_the_new_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "state.npz"
    write_durably(path, b"old")
    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OutputError, match="No space left"):
        write_durably(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
