"""The folder of one harvest: it grows while the robot works, survives a kill, and is whole at the end."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import TracebackType
from typing import Any

from punnet.errors import FileFormatError, OutputError, OutputExistsError
from punnet.harvest.durable import AppendOnlyLog, read_lines, write_durably
from punnet.outputs import (
    MARKER_FILE,
    Interrupted,
    OutputFolder,
    mark,
    replace_folder,
    staging_beside,
    told_folder_errors,
)

__all__ = ["LOG_FILE", "LOG_SCHEMA", "HarvestFolder", "options_of"]

LOG_FILE = "harvest.jsonl"
LOG_SCHEMA = "punnet-harvest-log/1"
_RESUME = ".resume"


class HarvestFolder:
    """A context manager around the making of a harvest's folder.

    It works in the folder itself, so that what was done is found after a kill; if a complete one stands there (``force``),
    in ``<folder>-partial``, which takes its place at the end: a complete harvest is never replaced by half of one.

    Parameters
    ----------
    folder
        Where the results go.
    force
        Replace a folder that Punnet made earlier.
    resume
        Go on with what a killed or interrupted run left there.

    Raises
    ------
    OutputExistsError
        On entering, if the folder is in the way.
    OutputError
        On entering, if it can't be written, if there is nothing to resume, or another process works on it.
    Interrupted
        On leaving by Ctrl-C.
    """

    def __init__(self, folder: str | Path, *, force: bool = False, resume: bool = False) -> None:
        self._output = OutputFolder(folder, force=force)
        self.folder = self._output.folder
        self._shown = folder
        self.resume = resume
        self.path = self._place(resume)
        self._log: AppendOnlyLog | None = None
        self._worth_keeping = False

    @property
    def log(self) -> AppendOnlyLog:
        """The harvest log; valid inside the ``with`` block."""
        if self._log is None:
            raise OutputError(f"{self._shown}: is not open for writing")
        return self._log

    @property
    def resume_path(self) -> Path:
        """Where states to go on from are kept until the run is complete."""
        return self.path / _RESUME

    def keep(self) -> None:
        """From now on there is something worth keeping, whatever happens."""
        self._worth_keeping = True

    def __enter__(self) -> HarvestFolder:
        if not self.resume:
            self._begin()
        with told_folder_errors(self._shown):
            self.resume_path.mkdir(exist_ok=True)
            self._log = AppendOnlyLog(self.path / LOG_FILE)
        if self.resume:
            self.keep()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.log.close()
        self._log = None
        if error is None:
            shutil.rmtree(self.resume_path, ignore_errors=True)
            self._mark(self.path, complete=True)
            if self.path != self.folder:
                replace_folder(self.folder, self.path)
            return
        if not self._worth_keeping:
            shutil.rmtree(self.path, ignore_errors=True)
        kept = self.path if self._worth_keeping else None
        if isinstance(error, KeyboardInterrupt):
            raise Interrupted(kept) from error
        if kept is not None:
            error.add_note(f"kept what was finished in {kept}; --resume goes on with it")

    def _place(self, resume: bool) -> Path:
        """Where to work."""
        beside = self.folder.with_name(f"{self.folder.name}-partial")
        if not resume:
            return beside if _is_complete(self.folder) else self.folder
        for place in (beside, self.folder):
            if _is_begun(place) and not _is_complete(place):
                return place
        why = "is complete" if _is_complete(self.folder) else f"holds no {LOG_FILE} to go on with"
        raise OutputError(f"{self._shown}: {why}; leave --resume out to begin a harvest")

    def _begin(self) -> None:
        """An empty folder with its mark, in the place of what may be replaced."""
        try:
            self._output.require_replaceable()
        except OutputExistsError as error:
            if _is_begun(self.folder) and not _is_complete(self.folder):
                raise OutputExistsError(
                    f"{self._shown}: holds an unfinished harvest; --resume goes on with it, --force begins anew"
                ) from error
            raise
        if self.path != self.folder and self.path.exists() and not (self.path / MARKER_FILE).is_file():
            raise OutputExistsError(f"{self.path}: is in the way and was not made by punnet; move it")
        with told_folder_errors(self._shown):
            staging = staging_beside(self.path)
            self._mark(staging, complete=False)
            replace_folder(self.path, staging)  # it is never there without its mark

    @staticmethod
    def _mark(place: Path, *, complete: bool) -> None:
        write_durably(place / MARKER_FILE, mark(complete=complete))


def options_of(folder: str | Path) -> dict[str, Any]:
    """What an unfinished harvest was begun with, by its log: the options of the command.

    Raises
    ------
    OutputError
        If there is none.
    FileFormatError
        If the log is damaged.
    """
    path = HarvestFolder(folder, resume=True).path / LOG_FILE
    records, _ = read_lines(path)
    if not records:
        return {}
    first = records[0]
    if first.get("schema") != LOG_SCHEMA or not isinstance(first.get("options"), dict):
        raise FileFormatError(f"{path}: is not a harvest log ({LOG_SCHEMA})")
    return dict(first["options"])


def _is_begun(folder: Path) -> bool:
    log = folder / LOG_FILE
    return log.is_file() and log.stat().st_size > 0


def _is_complete(folder: Path) -> bool:
    try:
        mark = json.loads((folder / MARKER_FILE).read_text())
    except (OSError, ValueError):
        return False
    return isinstance(mark, dict) and bool(mark.get("complete"))
