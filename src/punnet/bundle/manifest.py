"""What a bundle says about itself: ``manifest.json``."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path, PurePosixPath
from typing import Any

from punnet.errors import BundleError

__all__ = ["BUNDLE_SCHEMA", "MANIFEST_FILE", "Manifest", "file_sha256"]

BUNDLE_SCHEMA = "punnet-bundle/1"
MANIFEST_FILE = "manifest.json"
MAY_BE_LEFT_OUT = frozenset({"restriction", "citation"})
ALLOWED_SUFFIXES = (".json", ".onnx")
SHA256 = re.compile(r"[0-9a-f]{64}")
BUNDLE_NAME = re.compile(r"[a-z0-9][a-z0-9._-]*")


@dataclass(frozen=True)
class Manifest:
    """Name, origin and checksums of a bundle.

    Parameters
    ----------
    name
        Lower-case letters, digits, dots, dashes.
    kind
        What can load it: ``"promp"``, ``"detector"``, …
    version
        Version of the model itself.
    licence
        SPDX identifier or a sentence on what may be done with it.
    restriction
        What must not be done with it, in a few words ("non-commercial use only"); empty if the licence says all.
        Commands that use the bundle say it.
    citation
        What to cite when it is used, empty if nothing.
    created
        ISO 8601 date and time.
    command
        The command that makes it again.
    seed
        Seed that the command used, None if nothing was drawn.
    data
        What it was made from.
    results
        Measured figures, by name.
    files
        SHA-256 (hexadecimal) of every other file, by its path inside the bundle.

    Raises
    ------
    BundleError
        If the name or a file's path, suffix or checksum is not acceptable.
    """

    name: str
    kind: str
    version: str
    licence: str
    created: str
    command: str
    restriction: str = ""
    citation: str = ""
    seed: int | None = None
    data: Mapping[str, Any] = field(default_factory=dict)
    results: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("name", "kind", "version", "licence", "created", "command"):
            if not isinstance(getattr(self, name), str) or not getattr(self, name):
                raise BundleError(f"bundle manifest: '{name}' must be a text that is not empty")
        for name in ("restriction", "citation"):
            if not isinstance(getattr(self, name), str):
                raise BundleError(f"bundle manifest: '{name}' must be a text")
        if not BUNDLE_NAME.fullmatch(self.name):
            raise BundleError(
                f"bundle manifest: name {self.name!r} must be lower-case letters, digits, . _ -"
            )
        if self.seed is not None and (isinstance(self.seed, bool) or not isinstance(self.seed, int)):
            raise BundleError(f"bundle manifest: seed must be an integer or null, got {self.seed!r}")
        for name in ("data", "results", "files"):
            if not isinstance(getattr(self, name), Mapping):
                raise BundleError(f"bundle manifest: '{name}' must be an object")
        for path, checksum in self.files.items():
            _require_safe_path(path)
            if not isinstance(checksum, str) or not SHA256.fullmatch(checksum):
                raise BundleError(f"bundle manifest: checksum of '{path}' is not 64 hexadecimal digits")

    def to_json(self) -> dict[str, Any]:
        """Plain JSON with the schema's name."""
        return {"schema": BUNDLE_SCHEMA, **asdict(self)}

    @classmethod
    def from_json(cls, data: object, *, where: str) -> Manifest:
        """Read what :meth:`to_json` wrote; ``where`` names the source in messages.

        Raises
        ------
        BundleError
            If the schema is unknown, or a field is missing, unknown or of the wrong kind.
        """
        if not isinstance(data, dict) or "schema" not in data:
            raise BundleError(f'{where}: not a bundle manifest; it needs "schema": "{BUNDLE_SCHEMA}"')
        if data["schema"] != BUNDLE_SCHEMA:
            raise BundleError(
                f"{where}: schema {data['schema']!r} is unknown here; this version reads '{BUNDLE_SCHEMA}': "
                "update punnet or make the bundle again"
            )
        known = {item.name for item in fields(cls)}
        given = {key: value for key, value in data.items() if key != "schema"}
        missing, unknown = sorted(known - MAY_BE_LEFT_OUT - set(given)), sorted(set(given) - known)
        if missing or unknown:
            raise BundleError(f"{where}: fields missing {missing}, unknown {unknown}")
        try:
            return cls(**given)
        except BundleError as error:
            raise BundleError(f"{where}: {error}") from error


def file_sha256(path: Path) -> str:
    """SHA-256 of a file in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _require_safe_path(path: object) -> None:
    if not isinstance(path, str) or not path:
        raise BundleError(f"bundle: file name {path!r} is not a text")
    parts = PurePosixPath(path).parts
    if path.startswith("/") or "\\" in path or ":" in path or any(part in ("..", ".") for part in parts):
        raise BundleError(f"bundle: file '{path}' leaves the bundle's folder")
    if path == MANIFEST_FILE or PurePosixPath(path).suffix not in ALLOWED_SUFFIXES:
        raise BundleError(
            f"bundle: file '{path}' must end in one of {ALLOWED_SUFFIXES}, and not be the manifest"
        )
