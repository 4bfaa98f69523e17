import json

import numpy as np
import pytest

from punnet.errors import BundleError, ConfigurationError, OutputExistsError
from punnet.harvest.benchmark import BenchmarkSettings, plant_seed, run_benchmark, run_plant
from punnet.harvest.benchmark_folder import FIGURES, PICTURE, read_figures
from punnet.outputs import MARKER_FILE

SETTINGS = BenchmarkSettings("easy", 5, "oracle")


def test_plants_of_two_benchmarks_differ():
    seeds = {plant_seed(seed, number) for seed in range(20) for number in range(50)}
    assert len(seeds) == 1000


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"suite": "hard"}, "hard"),
        ({"choice": "best"}, "best"),
        ({"planner": "rrt"}, "rrt.*fused"),
        ({"seed": -1}, "seed"),
    ],
)
def test_settings_are_checked(settings, named):
    with pytest.raises(ConfigurationError, match=named):
        BenchmarkSettings(**settings)


def test_counts_and_back_end_are_checked():
    with pytest.raises(ConfigurationError, match="clusters and workers"):
        run_benchmark(SETTINGS, 0)
    with pytest.raises(ConfigurationError, match="threads"):
        run_benchmark(SETTINGS, 1, backend="threads")


def test_a_detector_that_cannot_be_had_ends_it_at_once():
    with pytest.raises(BundleError, match="eyes-closed"):
        run_benchmark(BenchmarkSettings(perception="eyes-closed"), 2)


def test_a_planner_that_cannot_be_had_ends_it_at_once():
    with pytest.raises(BundleError, match="reach-nowhere"):
        run_benchmark(BenchmarkSettings(planner="fused", planner_bundle="reach-nowhere"), 2)


def test_workers_make_no_difference_and_a_run_goes_on_where_it_was(tmp_path):
    folder = tmp_path / "run"
    together = run_benchmark(SETTINGS, 2, workers=2, folder=folder)
    assert all(plant.error is None for plant in together.plants)
    assert [plant.number for plant in together.plants] == [0, 1]

    def without_computing(plant):
        return {name: value for name, value in plant.to_json().items() if name != "seconds_computing"}

    assert any(attempt.cut_error < 0.02 for plant in together.plants for attempt in plant.attempts)
    assert json.loads((folder / MARKER_FILE).read_text())["complete"] is True
    assert (folder / PICTURE).read_bytes().startswith(b"\x89PNG")

    (folder / "plants" / "000001.json").unlink()
    told = []
    again = run_benchmark(SETTINGS, 2, folder=folder, progress=lambda plant: told.append(plant.number))
    assert told == [0, 1]
    assert [without_computing(plant) for plant in again.plants] == [
        without_computing(plant) for plant in together.plants
    ]
    # plant 0 is the very one of the first run, computing seconds and all
    assert again.plants[0].to_json() == together.plants[0].to_json()
    figures = read_figures(folder)
    assert figures["suite"] == "easy"
    assert figures["suite_version"] == 1
    assert figures["clusters"] == 2
    assert figures == json.loads((folder / FIGURES).read_text())

    with pytest.raises(OutputExistsError, match="begun with seed 5"):
        run_benchmark(BenchmarkSettings("easy", 6, "oracle"), 2, folder=folder)


def test_a_plant_that_cannot_be_grown_ends_alone(monkeypatch):
    def cannot(*arguments, **options):
        raise ConfigurationError("no plant today")

    monkeypatch.setattr("punnet.harvest.benchmark.Session", cannot)
    result = run_plant(SETTINGS, 3)
    assert result.error == "no plant today"
    assert result.seed == plant_seed(5, 3)
    assert np.isclose(result.seconds_simulated, 0.0)
