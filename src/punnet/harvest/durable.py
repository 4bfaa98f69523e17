"""Files that survive a kill or a power cut: whole or not there, and a log that only grows."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

from punnet.errors import FileFormatError, OutputError

__all__ = ["AppendOnlyLog", "read_lines", "told_disk_errors", "write_durably"]


@contextlib.contextmanager
def told_disk_errors(place: Path) -> Iterator[None]:
    """Whatever the disk does not take under ``place`` is an :class:`OutputError`."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{place}: can't be written ({error.strerror or error})") from error


def write_durably(path: Path, content: bytes) -> None:
    """Write a file in one step and wait until the disk has it: after a kill there is the old one or the new one.

    Raises
    ------
    OutputError
        If it can't be written, as when the disk is full; nothing of it is left behind.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with beside.open("wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        beside.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)
        raise OutputError(f"{path}: can't be written ({error.strerror})") from error


def read_lines(path: Path) -> tuple[list[dict[str, Any]], int]:
    """Records of a log, and how many bytes they take: a line that a kill tore off at the end is no record.

    Raises
    ------
    FileFormatError
        If it can't be read, or a line before the last is damaged: then more than a kill has happened to it.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FileFormatError(f"{path}: can't be read ({error.strerror})") from error
    records: list[dict[str, Any]] = []
    good = 0
    lines = content.split(b"\n")
    for number, line in enumerate(lines[:-1], start=1):
        try:
            record = json.loads(line)
            if not isinstance(record, dict) or record.get("n") != len(records):
                raise ValueError("not the record that is due")
        except ValueError as error:
            if number == len(lines) - 1 and not lines[-1]:
                break
            raise FileFormatError(f"{path}: line {number} is damaged ({error})") from error
        records.append(record)
        good += len(line) + 1
    return records, good


class AppendOnlyLog:
    """JSON lines, each on the disk before :meth:`append` returns. A context manager; one process at a time writes.

    Every record gets its number ``n``, from 0, so that a missing one is noticed.

    Parameters
    ----------
    path
        The file; made if it is not there. A torn last line is cut off.

    Raises
    ------
    OutputError
        If it can't be written, or another process holds it.
    FileFormatError
        If what is there is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise OutputError(f"{path}: can't be written ({error.strerror})") from error
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self.records, self._length = read_lines(path)
            os.ftruncate(self._file, self._length)
            _sync_folder(path.parent)
        except BlockingIOError as error:
            os.close(self._file)
            raise OutputError(f"{path}: another process is writing it; wait for that to end") from error
        except BaseException:
            os.close(self._file)
            raise

    def append(self, kind: str, **fields: Any) -> dict[str, Any]:
        """Add a record; what it became.

        Raises
        ------
        OutputError
            If the disk does not take it; the log then ends where it did before.
        """
        record = {"n": len(self.records), "kind": kind, **fields}
        line = json.dumps(record, ensure_ascii=False, allow_nan=False).encode() + b"\n"
        try:
            os.lseek(self._file, self._length, os.SEEK_SET)
            written = 0
            while written < len(line):
                written += os.write(self._file, line[written:])
            os.fsync(self._file)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, self._length)
            raise OutputError(f"{self.path}: can't be written ({error.strerror})") from error
        self._length += len(line)
        self.records.append(record)
        return record

    def close(self) -> None:
        """Let go of the file; may be called twice."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def __enter__(self) -> AppendOnlyLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _sync_folder(folder: Path) -> None:
    """Wait until the disk knows the names in a folder."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
