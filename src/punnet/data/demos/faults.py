"""Faults of demonstrations: their codes, how bad each is, and the report that lists them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from punnet.data.faults import CountedFaults, Severity
from punnet.errors import FileFormatError

__all__ = ["DEMO_FAULTS", "DemoFault", "DemoReport", "EpisodeRefused"]

DEMO_FAULTS: dict[str, Severity] = {
    # an episode with one of these can't be read
    "unreadable": Severity.ERROR,
    "missing-field": Severity.ERROR,
    "duplicate-id": Severity.ERROR,
    "too-short": Severity.ERROR,
    "length-mismatch": Severity.ERROR,
    "not-finite": Severity.ERROR,
    "time-order": Severity.ERROR,
    "joint-count": Severity.ERROR,
    "bad-pose": Severity.ERROR,
    "bad-box": Severity.ERROR,
    "missing-image": Severity.ERROR,
    # it is read, but not fit for use as it is
    "unreadable-image": Severity.ERROR,
    "jump": Severity.ERROR,
    "not-psd": Severity.ERROR,
    # it is read, and worth a look
    "joint-limit": Severity.WARNING,
    "velocity-limit": Severity.WARNING,
    "time-gap": Severity.WARNING,
    "no-motion": Severity.WARNING,
    "duplicate": Severity.WARNING,
    "quaternion-norm": Severity.WARNING,
    "pose-mismatch": Severity.WARNING,
    "suspected-swap": Severity.WARNING,
    "suspected-mismatch": Severity.WARNING,
}
"""Every code there is, with its severity. Codes are stable: scripts may rely on them."""


@dataclass(frozen=True)
class DemoFault:
    """One thing wrong with one episode.

    Parameters
    ----------
    code
        A key of :data:`DEMO_FAULTS`.
    message
        What is wrong, and what to do.
    file
        Where it stands.
    episode
        Id of the episode, None for the whole file.
    """

    code: str
    message: str
    file: str
    episode: str | None = None

    def __post_init__(self) -> None:
        if self.code not in DEMO_FAULTS:
            raise KeyError(f"{self.code!r} is not a fault; known: {', '.join(DEMO_FAULTS)}")

    @property
    def severity(self) -> Severity:
        """How bad it is."""
        return DEMO_FAULTS[self.code]

    @property
    def where(self) -> str:
        """File and episode in words."""
        return self.file if self.episode is None else f"{self.file}: episode '{self.episode}'"

    def __str__(self) -> str:
        return f"{self.where}: {self.code}: {self.message}"

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "code": self.code,
            "severity": str(self.severity),
            "file": self.file,
            "episode": self.episode,
            "message": self.message,
        }


@dataclass(frozen=True)
class DemoReport(CountedFaults):
    """What a validator found.

    Parameters
    ----------
    path
        What was looked at.
    episodes
        How many could be read.
    faults
        What is wrong with them, and with those that could not.
    """

    path: Path
    episodes: int
    faults: tuple[DemoFault, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "path": str(self.path),
            "episodes": self.episodes,
            **self.counted(),
        }


class EpisodeRefused(FileFormatError):  # noqa: N818 (says what happened, as Interrupted does)
    """An episode can't be read; ``findings`` are (code, message) of all that is wrong with it."""

    def __init__(self, findings: Iterable[tuple[str, str]]) -> None:
        self.findings = list(findings)
        super().__init__("; ".join(message for _, message in self.findings))
