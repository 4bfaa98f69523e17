"""``punnet benchmark packing``: table, JSON, picture, and bad input."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture
def errors(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    true = rng.uniform(8, 32, 400)
    estimates = true * rng.normal(1, 0.08, 400)
    path = tmp_path / "errors.csv"
    rows = np.column_stack((true, estimates, 0.87 * estimates, 1.13 * estimates))
    np.savetxt(path, rows, fmt="%.3f", delimiter=",", header="true_g,estimate_g,low_g,high_g", comments="")
    return path


QUICK = ("--batches", "2", "--berries", "200")


def test_table_and_picture(punnet, errors: Path, tmp_path: Path) -> None:
    picture = tmp_path / "packing.png"
    result = punnet("benchmark", "packing", errors, *QUICK, "--out", picture)
    assert result.code == 0, result.err
    for words in ("with weigh cells", "without weigh cells", "look-ahead", "first-fit", "berries each"):
        assert words in result.out
    assert picture.read_bytes().startswith(b"\x89PNG")
    punnet("benchmark", "packing", errors, *QUICK, "--out", picture).fails_with("exists", "--force")


def test_json_and_another_nominal_weight(punnet, errors: Path) -> None:
    options = ("--nominal", "400", "--most-berries", "30", "--open", "2", "--cell-error", "1", "--seed", "5")
    result = punnet("benchmark", "packing", errors, *QUICK, *options, "--weights", errors, "--json")
    assert result.code == 0, result.err
    figures = json.loads(result.out)
    assert (figures["nominal_g"], figures["tolerance_g"], figures["places"]) == (400.0, 12.0, 2)
    assert figures["population"]["mean_g"] == pytest.approx(20.0, abs=1.0)
    assert figures["settings"][0]["cell_error_g"] == 1.0
    assert figures["settings"][1]["cell_error_g"] is None


def test_bad_input(punnet, errors: Path, tmp_path: Path) -> None:
    punnet("benchmark", "packing", tmp_path / "none.json").fails_with("none.json", "can't be read")
    punnet("benchmark", "packing", errors, "--nominal", "0").fails_with("no tolerance")
    punnet("benchmark", "packing", errors, "--nominal", "20000").fails_with("goes up to 10000 g")
    punnet("benchmark", "packing", errors, "--out", tmp_path / "a.svg").fails_with("a.svg", "ends in .png")
    assert punnet("benchmark", "packing", errors, "--open", "0").code == 2
