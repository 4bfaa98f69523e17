"""Writing a bundle: all of it or nothing."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from punnet.bundle.manifest import MANIFEST_FILE, Manifest, file_sha256
from punnet.errors import BundleError, OutputExistsError

__all__ = ["write_bundle"]


def write_bundle(
    folder: str | Path,
    *,
    name: str,
    kind: str,
    files: Mapping[str, Any],
    licence: str,
    command: str,
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
    name, kind, licence, command, seed, data, results, version, created
        See :class:`Manifest`; ``created`` is now if not given.
    force
        Replace an existing bundle.

    Raises
    ------
    OutputExistsError
        If the folder exists and ``force`` is not set, or it exists and is no bundle.
    BundleError
        If a name, suffix or value is not acceptable or the disk refuses.
    """
    folder = Path(folder)
    _require_free(folder, force=force)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    except OSError as error:
        raise BundleError(f"{folder}: can't be written ({error.strerror}); choose another folder") from error
    try:
        # A manifest without checksums first: it refuses bad names before anything is written under them.
        details: dict[str, Any] = {
            "name": name, "kind": kind, "version": version, "licence": licence, "command": command, "seed":
            seed, "created": created or datetime.now(UTC).isoformat(timespec="seconds"), "data": dict(data or
            {}), "results": dict(results or {}),
        }  # fmt: skip
        Manifest(**details, files=dict.fromkeys(files, "0" * 64))
        for file, content in files.items():
            _write_file(staging / file, content)
        manifest = Manifest(**details, files={file: file_sha256(staging / file) for file in sorted(files)})
        _write_file(staging / MANIFEST_FILE, manifest.to_json())
        staging.chmod(0o755)
        _swap(staging, folder)
    except OSError as error:
        raise BundleError(f"{folder}: can't be written ({error.strerror or error})") from error
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    return manifest


def _require_free(folder: Path, *, force: bool) -> None:
    if not folder.exists():
        return
    if not force:
        raise OutputExistsError(f"{folder}: exists already; pass --force to replace it")
    if not (folder / MANIFEST_FILE).is_file() and not (folder.is_dir() and not any(folder.iterdir())):
        raise OutputExistsError(f"{folder}: is not a bundle, so it is not replaced; choose another folder")


def _write_file(path: Path, content: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(content, Path):
        shutil.copyfile(content, path)
    elif isinstance(content, bytes):
        path.write_bytes(content)
    else:
        try:
            text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise BundleError(f"bundle: '{path.name}' can't be written as JSON ({error})") from error
        path.write_text(text + "\n", encoding="utf-8")


def _swap(staging: Path, folder: Path) -> None:
    if not folder.exists():
        staging.rename(folder)
        return
    previous = Path(tempfile.mkdtemp(prefix=f".{folder.name}-old-", dir=folder.parent))
    folder.rename(previous / folder.name)
    try:
        staging.rename(folder)
    except OSError:
        (previous / folder.name).rename(folder)
        raise
    finally:
        shutil.rmtree(previous, ignore_errors=True)
