"""Writing a bundle: all of it or nothing."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from punnet.bundle.manifest import MANIFEST_FILE, Manifest, file_sha256
from punnet.errors import BundleError
from punnet.outputs import OutputFolder

__all__ = ["require_bundle_place", "write_bundle"]


def require_bundle_place(folder: str | Path, *, force: bool = False) -> None:
    """Refuse at once, before long work, a place where :func:`write_bundle` would not write in the end.

    Raises
    ------
    OutputExistsError, OutputError
        As it does.
    """
    OutputFolder(folder, force=force, marker=MANIFEST_FILE).require_replaceable()


def write_bundle(
    folder: str | Path,
    *,
    name: str,
    kind: str,
    files: Mapping[str, Any],
    licence: str,
    command: str,
    restriction: str = "",
    citation: str = "",
    seed: int | None = None,
    data: Mapping[str, Any] | None = None,
    results: Mapping[str, Any] | None = None,
    version: str = "1",
    created: str | None = None,
    force: bool = False,
) -> Manifest:
    """Write a bundle in one step: readers see the old folder or the complete new one, never half of it.

    Parameters
    ----------
    folder
        Where it goes; parents are made.
    files
        By path inside the bundle: a :class:`~pathlib.Path` is copied, bytes are written as they are, anything
        else is written as JSON. Only ``.json`` and ``.onnx`` are allowed.
    name, kind, licence, command, restriction, citation, seed, data, results, version, created
        See :class:`Manifest`; ``created`` is now if not given.
    force
        Replace an existing bundle.

    Raises
    ------
    OutputExistsError
        If the folder exists and ``force`` is not set, or it exists and is no bundle.
    OutputError
        If the folder can't be written.
    BundleError
        If a name, suffix or value is not acceptable.
    """
    # A manifest without checksums first: it refuses bad names before anything is written under them.
    details: dict[str, Any] = {
        "name": name,
        "kind": kind,
        "version": version,
        "licence": licence,
        "command": command,
        "restriction": restriction,
        "citation": citation,
        "seed": seed,
        "created": created or datetime.now(UTC).isoformat(timespec="seconds"),
        "data": dict(data or {}),
        "results": dict(results or {}),
    }
    Manifest(**details, files=dict.fromkeys(files, "0" * 64))
    with OutputFolder(folder, force=force, marker=MANIFEST_FILE) as output:
        for file, content in files.items():
            _write_file(output.path / file, content)
        sums = {file: file_sha256(output.path / file) for file in sorted(files)}
        manifest = Manifest(**details, files=sums)
        _write_file(output.path / MANIFEST_FILE, manifest.to_json())
    return manifest


def _write_file(path: Path, content: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(content, Path):
        try:
            shutil.copyfile(content, path)
        except OSError as error:
            raise BundleError(f"{content}: can't be written into the bundle ({error.strerror})") from error
    elif isinstance(content, bytes):
        path.write_bytes(content)
    else:
        try:
            text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise BundleError(f"bundle: '{path.name}' can't be written as JSON ({error})") from error
        path.write_text(text + "\n", encoding="utf-8")
