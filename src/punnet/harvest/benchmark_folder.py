"""The folder of a benchmark: one file a plant as it is done, and the figures at the end."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from punnet.errors import FileFormatError
from punnet.harvest.benchmark_picture import draw_outcomes
from punnet.harvest.benchmark_plants import PlantResult
from punnet.outputs import MARKER_FILE, mark, write_bytes, write_text
from punnet.sim.growing_folder import open_folder

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
        FileFormatError
            If it is damaged, or of another version.
        OutputError
            If it can't be made.
        """
        open_folder(
            self.folder, _SETTINGS, self.settings, what="harvest benchmark", parts=[_PLANTS], force=force
        )

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
        write_bytes(self.folder / MARKER_FILE, mark(complete=True), force=True)


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
