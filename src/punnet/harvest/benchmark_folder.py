"""The folder of a benchmark: one file a plant as it is done, and the figures at the end."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from punnet.errors import FileFormatError, OutputError, OutputExistsError
from punnet.harvest.benchmark_picture import draw_outcomes
from punnet.harvest.benchmark_plants import PlantResult
from punnet.outputs import MARKER_FILE, write_bytes, write_text

__all__ = ["FIGURES", "PICTURE", "SCHEMA", "BenchmarkFolder", "read_figures"]

SCHEMA = "punnet-harvest-benchmark/2"
FIGURES = "figures.json"
PICTURE = "missed.png"
_SETTINGS, _PLANTS = "benchmark.json", "plants"


class BenchmarkFolder:
    """A folder that grows by one plant at a time.

    Parameters
    ----------
    folder
        The place.
    settings
        What decides its figures, but for how many plants there are.
    """

    def __init__(self, folder: str | Path, settings: dict[str, Any]) -> None:
        self.folder = Path(folder).expanduser()
        self.settings = settings

    def open(self, *, force: bool) -> None:
        """Make the folder, or find that it holds plants of the same settings.

        Raises
        ------
        OutputExistsError
            If it was begun with other settings and ``force`` is not set, or is something else.
        OutputError
            If it can't be made.
        """
        place = self.folder
        if place.exists() and not place.is_dir():
            raise OutputError(f"{place}: a file stands where a folder is needed; give another folder")
        found = _read(place / _SETTINGS) if (place / _SETTINGS).is_file() else None
        if found is None and place.is_dir() and any(place.iterdir()):
            raise OutputExistsError(f"{place}: exists and is no harvest benchmark; give another folder")
        if found is not None and force:
            shutil.rmtree(place)
            found = None
        if found is not None:
            other = [
                name for name in {**self.settings, **found} if self.settings.get(name) != found.get(name)
            ]
            if other:
                was = ", ".join(f"{name} {found.get(name, 'not given')!r}" for name in other)
                raise OutputExistsError(
                    f"{place}: was begun with {was}; go on with the same, give another folder, or --force"
                )
            return
        try:
            (place / _PLANTS).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{place}: can't be written ({error.strerror}); give another folder") from error
        _write(place / MARKER_FILE, {"made_by": "punnet", "complete": False})
        _write(place / _SETTINGS, self.settings)

    def results(self) -> dict[int, PlantResult]:
        """The plants that are done, by number.

        Raises
        ------
        FileFormatError
            If a file is damaged.
        """
        paths = sorted((self.folder / _PLANTS).glob("*.json"))
        results = (PlantResult.from_json(_read(path), str(path)) for path in paths)
        return {result.number: result for result in results}

    def add(self, result: PlantResult) -> None:
        """Keep a plant; from then on it counts as done. One that could not be grown is not kept, and tried again."""
        if result.error is None or result.fates:
            _write(self.folder / _PLANTS / f"{result.number:06d}.json", result.to_json())

    def complete(self, figures: dict[str, Any]) -> None:
        """Write the figures and the picture of all that was asked for."""
        _write(self.folder / FIGURES, figures)
        write_bytes(self.folder / PICTURE, draw_outcomes([figures]), force=True)
        _write(self.folder / MARKER_FILE, {"made_by": "punnet", "complete": True})


def read_figures(folder: str | Path) -> dict[str, Any]:
    """The figures in a benchmark's folder.

    Raises
    ------
    FileFormatError
        If there are none, they are damaged, or of another version.
    """
    path = Path(folder) / FIGURES
    if not path.is_file():
        raise FileFormatError(f"{folder}: holds no {FIGURES}; punnet benchmark harvest --out writes one")
    found = _read(path)
    if "suite" not in found or "success" not in found:
        raise FileFormatError(f"{path}: no figures of a harvest benchmark")
    if found.get("schema") != SCHEMA:
        raise FileFormatError(
            f"{path}: schema {found.get('schema')!r} is unknown here, this version reads '{SCHEMA}'; measure again"
        )
    return found


def _read(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FileFormatError(f"{path}: can't be read as JSON ({error})") from error
    if not isinstance(found, dict):
        raise FileFormatError(f"{path}: must hold a JSON object")
    return found


def _write(path: Path, content: dict[str, Any]) -> None:
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n", force=True)
