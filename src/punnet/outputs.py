"""Outputs: written beside their place and moved there when complete, so that no file or folder is half there."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

from punnet.errors import OutputError, OutputExistsError

__all__ = [
    "FIGURES",
    "MARKER_FILE",
    "Interrupted",
    "OutputFolder",
    "mark",
    "replace_folder",
    "require_folder_name",
    "require_suffix",
    "staging_beside",
    "told_folder_errors",
    "write_bytes",
    "write_text",
]

FIGURES = (".png", ".svg", ".pdf")
"""Ends of names that a figure is written as."""

MARKER_FILE = ".punnet-output.json"
"""Marks a folder as made by Punnet; ``force`` replaces no other."""

PICTURES = (".bmp", ".gif", ".jpeg", ".jpg", ".pdf", ".png", ".svg", ".tif", ".tiff", ".webp")
OTHER_FILES = (".csv", ".html", ".json", ".md", ".mp4", ".npz", ".onnx", ".parquet", ".txt", ".zip")
FILE_SUFFIXES = {*PICTURES, *OTHER_FILES}
"""Ends of names that nobody gives to a folder."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, with what was kept: ``kept`` is the folder of the partial results, None if there were none."""

    def __init__(self, kept: Path | None) -> None:
        super().__init__()
        self.kept = kept


class OutputFolder:
    """A context manager around the making of a folder of results.

    Inside, files are written to :attr:`path`, a staging folder beside the final place; call :meth:`finished`
    for each piece that is worth keeping by itself. At the end the staging folder takes its place. If an
    exception ends the work and pieces were finished, they are kept: in the final place if that is free, else
    in ``<folder>-partial``, so that a complete result is never replaced by a partial one.

    Parameters
    ----------
    folder
        Where the results go.
    force
        Replace a folder that Punnet made earlier.
    marker
        File by which such a folder is known. The default is written here; any other, like a bundle's manifest, is the
        caller's to write.

    Raises
    ------
    OutputExistsError
        On entering, if the folder exists and ``force`` is not set, or if it was not made by Punnet.
    OutputError
        On entering, if the folder can't be written or has the name of a file, as ``sheet.png``.
    Interrupted
        On leaving by Ctrl-C.
    """

    def __init__(self, folder: str | Path, *, force: bool = False, marker: str = MARKER_FILE) -> None:
        self.folder = Path(folder).expanduser().absolute()
        self.force = force
        self._marker = marker
        self.pieces = 0
        self._shown = folder
        self._staging: Path | None = None

    @property
    def path(self) -> Path:
        """The staging folder; valid inside the ``with`` block."""
        if self._staging is None:
            raise OutputError(f"{self._shown}: is not open for writing")
        return self._staging

    def finished(self) -> None:
        """Count one piece of the results as worth keeping."""
        self.pieces += 1

    def __enter__(self) -> OutputFolder:
        with told_folder_errors(self._shown):
            self.require_replaceable()
            self._staging = staging_beside(self.folder)
            self._mark(self._staging, complete=False)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        staging, self._staging = self.path, None
        if error is None:
            self._mark(staging, complete=True)
            replace_folder(self.folder, staging)
            return
        kept = self._keep(staging) if self.pieces else None
        shutil.rmtree(staging, ignore_errors=True)
        if isinstance(error, KeyboardInterrupt):
            raise Interrupted(kept) from error
        if kept is not None:
            error.add_note(f"kept what was finished in {kept}")

    def _mark(self, staging: Path, *, complete: bool) -> None:
        if self._marker == MARKER_FILE:
            (staging / MARKER_FILE).write_bytes(mark(complete=complete))

    def require_replaceable(self) -> None:
        """Refuse a folder that stands in the way: on entering, or before long work whose result goes there.

        Raises
        ------
        OutputExistsError
            If it exists and ``force`` is not set, or it was not made by Punnet.
        OutputError
            If it has the name of a file.
        """
        folder = self.folder
        require_folder_name(self._shown)
        if not folder.exists() and not folder.is_symlink():
            return
        if not self.force:
            raise OutputExistsError(f"{self._shown}: exists; give another folder or --force")
        if not (folder / self._marker).is_file() and not (folder.is_dir() and not any(folder.iterdir())):
            raise OutputExistsError(
                f"{self._shown}: exists and was not made by punnet, so --force does not replace it; "
                "give another folder"
            )

    def _keep(self, staging: Path) -> Path | None:
        place = self.folder
        if place.exists():
            place = place.with_name(f"{place.name}-partial")
            if place.exists() and not (place / self._marker).is_file():
                return None
        replace_folder(place, staging)
        return place


def mark(*, complete: bool) -> bytes:
    """What stands in :data:`MARKER_FILE`."""
    return json.dumps({"made_by": "punnet", "complete": complete}).encode() + b"\n"


def require_folder_name(folder: str | Path) -> None:
    """Refuse to make a folder that is called like a file.

    Raises
    ------
    OutputError
        If its name ends so and it does not exist.
    """
    folder = Path(folder).expanduser()
    if folder.suffix.lower() in FILE_SUFFIXES and not folder.exists():
        raise OutputError(
            f"{folder}: is called like a file, but a folder is written; leave '{folder.suffix}' out"
        )


def require_suffix(path: str | Path, *suffixes: str) -> None:
    """Refuse to write a file under a name that says it is something else.

    Raises
    ------
    OutputError
        If it ends in none of ``suffixes``, capitals or not.
    """
    if Path(path).suffix.lower() not in suffixes:
        raise OutputError(f"{path}: give a name that ends in {' or '.join(suffixes)}")


@contextmanager
def told_folder_errors(folder: str | Path) -> Iterator[None]:
    """Inside, whatever keeps ``folder`` from being made is an :class:`OutputError` that names it as given."""
    try:
        yield
    except (FileExistsError, NotADirectoryError) as error:
        raise OutputError(
            f"{folder}: can't be made, a file stands where a folder is needed; give another folder"
        ) from error
    except OSError as error:
        raise OutputError(f"{folder}: can't be written ({error.strerror}); give another folder") from error


def staging_beside(folder: Path) -> Path:
    """A new empty folder with a hidden name beside ``folder``, which :func:`replace_folder` moves there."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    staging.chmod(0o755)
    return staging


def write_text(path: str | Path, text: str, *, force: bool = False) -> Path:
    """Write a file of UTF-8 text as :func:`write_bytes` does."""
    return write_bytes(path, text.encode("utf-8"), force=force)


def write_bytes(path: str | Path, content: bytes, *, force: bool = False) -> Path:
    """Write a file, whole or not at all; its folder is made if need be.

    Raises
    ------
    OutputExistsError
        If the file exists and ``force`` is not set, or a folder stands in its place.
    OutputError
        If it can't be written.
    """
    path = Path(path).expanduser()
    if path.is_dir():
        raise OutputExistsError(f"{path}: is a folder; give the name of a file")
    if not force and (path.exists() or path.is_symlink()):
        raise OutputExistsError(f"{path}: exists; give another name or --force")
    staging: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}-", delete=False) as stream:
            staging = Path(stream.name)
            stream.write(content)
        staging.chmod(0o644)
        staging.replace(path)
    except (FileExistsError, NotADirectoryError) as error:
        raise OutputError(f"{path}: can't be written, a file stands where a folder is needed") from error
    except OSError as error:
        raise OutputError(f"{path}: can't be written ({error.strerror}); give another place") from error
    finally:
        if staging is not None:
            staging.unlink(missing_ok=True)
    return path


def replace_folder(place: Path, staging: Path) -> None:
    """Move the folder ``staging`` to ``place``; what was there goes once the new one is in its place."""
    if not place.exists():
        staging.rename(place)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{place.name}-old-", dir=place.parent))
    place.rename(old / place.name)
    try:
        staging.rename(place)
    except OSError:
        (old / place.name).rename(place)
        raise
    finally:
        shutil.rmtree(old, ignore_errors=True)
