"""What a harvest writes down while it runs, and how it is read back to go on."""

from __future__ import annotations

import datetime
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from punnet import __version__
from punnet.errors import FileFormatError
from punnet.harvest.attempts import Attempt, History, Phase
from punnet.harvest.durable import told_disk_errors, write_durably
from punnet.harvest.failures import Failure, Recovery
from punnet.harvest.folder import LOG_SCHEMA, HarvestFolder
from punnet.harvest.scenario import Session
from punnet.movement import TrajectoryDistribution
from punnet.scene import Frame, Strawberries
from punnet.sim.film import Recorder
from punnet.sim.snapshot import restore_snapshot, take_snapshot

__all__ = ["SessionJournal"]


class SessionJournal:
    """Keeps the log of a session, with the files and the state of the world that each attempt leaves.

    An attempt counts once its line ``attempt_ended`` is on the disk. Before that, its files, the film's states and the
    state of the world were written; so what a line names is there, and what no line names is overwritten.

    Parameters
    ----------
    folder
        Open.
    options
        Of the command, written into the first line.
    """

    def __init__(
        self, folder: HarvestFolder, session: Session, recorder: Recorder, options: Mapping[str, Any]
    ) -> None:
        self._folder = folder
        self._session = session
        self._recorder = recorder
        self._saved_states = 0
        self.history = History()
        if not folder.log.records:
            folder.log.append(
                "begun",
                schema=LOG_SCHEMA,
                created=_now(),
                punnet=__version__,
                options=dict(options),
            )
        else:
            self._read()

    @property
    def created(self) -> str:
        """When the run was begun, ISO 8601."""
        return str(self._folder.log.records[0]["created"])

    def begin(self, attempt: Attempt) -> None:
        """Note the attempt that is in flight from now on."""
        self._folder.keep()
        self._folder.log.append("attempt_begun", number=attempt.number, time=_now())

    def end(self, attempt: Attempt) -> None:
        """Write down everything that the attempt leaves, and last the line by which it counts."""
        number = attempt.number
        with told_disk_errors(self._attempt_folder(number)):
            _save_files(self._attempt_folder(number), attempt)
        state = self._resume_file("state", number)
        write_durably(self._resume_file("film", number), self._recorder.archive(self._saved_states))
        write_durably(state, take_snapshot(self._session.robot))
        self._saved_states = len(self._recorder.states)
        run = self._session.harvester.run_so_far
        self._folder.log.append(
            "attempt_ended",
            time=_now(),
            **attempt.to_json(),
            class_index=int(attempt.berry.classes[0]),
            true_g=self._session.truth_of.get(number),
            seconds=[run.seconds_simulated, run.seconds_computing],
            places=self._session.harvester.memory.to_json(),
        )
        self._resume_file("state", number - 1).unlink(missing_ok=True)

    def failed(self, phase: Phase, failure: Failure, reason: str, recovery: Recovery) -> None:
        """Write down a step that failed, and what is done about it."""
        self.note(
            "failed", phase=str(phase), failure=failure.name.lower(), reason=reason, recovery=str(recovery)
        )

    def note(self, kind: str, **fields: Any) -> None:
        """Write down something else that happened."""
        self._folder.log.append(kind, time=_now(), **fields)

    def _read(self) -> None:
        """Read back what was done, bring the world to where it was left, and note that it goes on from there."""
        history = self.history
        for record in self._folder.log.records:
            kind = record.get("kind")
            if kind == "attempt_begun":
                history.lost = int(record["number"])
            elif kind == "attempt_ended":
                attempt = _load_files(self._attempt_folder(int(record["number"])), record)
                history.attempts.append(attempt)
                history.places = record["places"]
                simulated, computing = record["seconds"]
                history.seconds = (float(simulated), float(computing))
                history.lost = None
                if record["true_g"] is not None:
                    self._session.truth_of[attempt.number] = float(record["true_g"])
            elif kind == "resumed":
                history.resumed.append(int(record["with"]))
        done = len(history.attempts)
        if done:
            restore_snapshot(self._session.robot, _bytes_of(self._resume_file("state", done)))
            for attempt in history.attempts:
                self._recorder.add_archive(_bytes_of(self._resume_file("film", attempt.number)))
            self._saved_states = len(self._recorder.states)
        history.resumed.append(done + 1)
        self.note("resumed", **{"with": done + 1, "lost": history.lost})

    def _attempt_folder(self, number: int) -> Path:
        return self._folder.path / "picks" / f"{number:03d}"

    def _resume_file(self, what: str, number: int) -> Path:
        return self._folder.resume_path / f"{what}-{number:05d}.npz"


def _save_files(folder: Path, attempt: Attempt) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    attempt.frame.save(folder / "frame", force=True)
    write_durably(folder / "berries.json", _json(attempt.berries.to_json()))
    reach = folder / "reach.json"
    if attempt.distribution is None:
        reach.unlink(missing_ok=True)  # of an attempt of that number that was lost
    else:
        write_durably(reach, _json(attempt.distribution.to_json()))


def _load_files(folder: Path, record: dict[str, Any]) -> Attempt:
    frame = Frame.load(folder / "frame")
    berries = Strawberries.from_json(_loaded(folder / "berries.json"))
    reach = folder / "reach.json"
    distribution = TrajectoryDistribution.from_json(_loaded(reach)) if reach.is_file() else None
    return Attempt.from_json(record, frame, berries, distribution)


def _json(value: Any) -> bytes:
    return json.dumps(value, allow_nan=False).encode() + b"\n"


def _loaded(path: Path) -> Any:
    try:
        return json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise FileFormatError(f"{path}: can't be read ({error}); the harvest can't go on") from error


def _bytes_of(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise FileFormatError(f"{path}: can't be read ({error.strerror}); the harvest can't go on") from error


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
