"""Folders of training runs: each belongs to one set of settings, and a stopped run goes on in its own."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from punnet.errors import FileFormatError, OutputError, OutputExistsError
from punnet.outputs import require_folder_name, write_text

__all__ = ["as_json", "claim_run", "finished_run", "read_object", "require_run_place"]


def require_run_place(folder: Path, file: str, *, what: str) -> None:
    """Refuse at once, before long work, a place that can't be a run's folder, whatever its settings.

    Parameters
    ----------
    folder, file, what
        As for :func:`claim_run`.

    Raises
    ------
    OutputExistsError
        If it holds something else.
    OutputError
        If it is a file, or called like one.
    """
    require_folder_name(folder)
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder}: a file stands where a folder is needed; give another folder")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / file).is_file():
        raise OutputExistsError(f"{folder}: exists and holds no {what}; give another folder")


def claim_run(folder: Path, file: str, settings: Mapping[str, Any], *, what: str) -> None:
    """Make the folder the run of these settings, or find that it is; parents are made.

    Parameters
    ----------
    folder
        Of the run.
    file
        In it, for the settings.
    settings
        Plain JSON.
    what
        To call such a run in messages.

    Raises
    ------
    OutputExistsError
        If it holds something else, or a run with other settings.
    OutputError
        If it is a file, or called like one.
    """
    require_run_place(folder, file, what=what)
    if (folder / file).is_file():
        found = read_object(folder / file)
        if other := [name for name in settings if settings[name] != found.get(name)]:
            raise OutputExistsError(
                f"{folder}: holds a run with other {', '.join(other)}; give another folder, or the same settings"
            )
        return
    write_text(folder / file, as_json(settings))


def finished_run(
    folder: Path, file: str, results: str, *, schema: str, what: str
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Settings and results of a run that came to its end.

    Parameters
    ----------
    folder
        Of the run.
    file, results
        In it: of the settings, and what is written last.
    schema
        That the settings have to be of.
    what
        To call such a run in messages.

    Raises
    ------
    FileFormatError
        If the folder holds no such run, or it was stopped before its end.
    """
    settings = read_object(folder / file)
    if settings.get("schema") != schema:
        raise FileFormatError(f"{folder / file}: not the settings of a {what} ({schema})")
    if not (folder / results).is_file():
        raise FileFormatError(f"{folder}: this run was stopped; start it again, it goes on where it was")
    return settings, read_object(folder / results)


def read_object(path: Path) -> dict[str, Any]:
    """A JSON object from a file.

    Raises
    ------
    FileFormatError
        If it is missing, can't be read or is no object.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError) as error:
        raise FileFormatError(f"{path}: no such file") from error
    except (OSError, ValueError) as error:
        raise FileFormatError(f"{path}: not readable as JSON ({error})") from error
    if not isinstance(data, dict):
        raise FileFormatError(f"{path}: a JSON object is needed")
    return data


def as_json(data: Any) -> str:
    """Text of a JSON file; NaN is refused."""
    return json.dumps(data, indent=1, allow_nan=False) + "\n"
