"""Loading and listing bundles. Every file's checksum is verified before anything is read from it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from punnet.bundle.manifest import MANIFEST_FILE, Manifest, file_sha256
from punnet.errors import BundleError

__all__ = ["SHIPPED_FOLDER", "Bundle", "list_bundles", "load_bundle"]

SHIPPED_FOLDER = Path(__file__).resolve().parent / "shipped"


@dataclass(frozen=True)
class Bundle:
    """A verified bundle: its folder and its manifest."""

    folder: Path
    manifest: Manifest

    @property
    def name(self) -> str:
        """Name from the manifest."""
        return self.manifest.name

    @property
    def kind(self) -> str:
        """Kind from the manifest."""
        return self.manifest.kind

    def path(self, file: str) -> Path:
        """Path of one of its files.

        Raises
        ------
        BundleError
            If the manifest has no such file.
        """
        if file not in self.manifest.files:
            raise BundleError(f"bundle '{self.name}': no file '{file}'; it has {sorted(self.manifest.files)}")
        return self.folder / file

    def read_json(self, file: str) -> Any:
        """Contents of one of its JSON files.

        Raises
        ------
        BundleError
            If there is no such file or it is not JSON.
        """
        path = self.path(file)
        try:
            return json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise BundleError(f"{path}: not readable as JSON ({error})") from error


def load_bundle(source: str | Path, *, kind: str | None = None) -> Bundle:
    """Open a bundle and verify every file.

    Parameters
    ----------
    source
        A folder, or the name of a bundle that comes with the package. A text without a path separator that is
        no existing folder is taken as a name.
    kind
        The kind that the caller can use; None takes any.

    Raises
    ------
    BundleError
        If there is no such bundle, its schema is unknown, a file is missing or damaged, or the kind
        is another.
    """
    folder = _find_folder(source)
    manifest = _read_manifest(folder)
    for file, expected in manifest.files.items():
        path = folder / file
        if not path.is_file():
            raise BundleError(f"{folder}: file '{file}' of the manifest is missing; copy the bundle again")
        actual = file_sha256(path)
        if actual != expected:
            raise BundleError(
                f"{path}: checksum is {actual[:12]}…, the manifest says {expected[:12]}…; the file is "
                "damaged or was changed: copy the bundle again"
            )
    if kind is not None and manifest.kind != kind:
        raise BundleError(f"{folder}: is a bundle of kind '{manifest.kind}'; '{kind}' is needed here")
    return Bundle(folder, manifest)


def list_bundles(folder: str | Path | None = None) -> list[Manifest]:
    """Manifests of the bundles in a folder (those that come with the package if None), by name.

    Files are not verified here; :func:`load_bundle` does that.

    Raises
    ------
    BundleError
        If a manifest is damaged or the folder does not exist.
    """
    root = SHIPPED_FOLDER if folder is None else Path(folder)
    if not root.is_dir():
        if folder is None:
            return []
        raise BundleError(f"{root}: no such folder")
    found = [_read_manifest(path.parent) for path in root.glob(f"*/{MANIFEST_FILE}")]
    return sorted(found, key=lambda manifest: manifest.name)


def _find_folder(source: str | Path) -> Path:
    path = Path(source)
    if path.is_dir():
        return path
    if isinstance(source, str) and path.name == source and (SHIPPED_FOLDER / source).is_dir():
        return SHIPPED_FOLDER / source
    shipped = ", ".join(manifest.name for manifest in list_bundles()) or "none"
    raise BundleError(
        f"{source}: neither a folder nor a bundle that comes with punnet (those are: {shipped})"
    )


def _read_manifest(folder: Path) -> Manifest:
    path = folder / MANIFEST_FILE
    if not path.is_file():
        raise BundleError(f"{folder}: not a bundle, it has no {MANIFEST_FILE}")
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise BundleError(f"{path}: not readable as JSON ({error})") from error
    return Manifest.from_json(data, where=str(path))
