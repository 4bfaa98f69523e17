from pathlib import Path

import numpy as np
import pytest

from punnet.bundle import load_bundle
from punnet.errors import ConfigurationError, OutputError, OutputExistsError
from punnet.movement import TrajectoryDistribution
from punnet.sim.demonstrations import simulate_demonstrations
from punnet.sim.reach_bundle import build_reach_bundle, fit_reach


def test_shipped_bundle_is_what_its_command_makes() -> None:
    bundle = load_bundle("promp-reach-sim", kind="promp")
    assert bundle.manifest.command == "punnet demos simulate --configs 25 --repeats 10 --seed 0 --bundle DIR"
    shipped = TrajectoryDistribution.from_json(bundle.read_json("promp.json"))
    # Loose: on another processor a reach at the edge of acceptance may be drawn again.
    ours = fit_reach(simulate_demonstrations(np.random.default_rng(0), 25, 10))
    np.testing.assert_allclose(shipped.weight_mean, ours.weight_mean, atol=0.02)
    np.testing.assert_allclose(shipped.weight_covariance, ours.weight_covariance, atol=0.02)


def test_build_evaluates_on_what_it_left_out(tmp_path: Path) -> None:
    manifest = build_reach_bundle(tmp_path / "reach", configurations=6, repeats=3, seed=1)
    assert load_bundle(tmp_path / "reach").manifest == manifest
    results = manifest.results["leave_one_configuration_out"]
    assert results["planned"] == 1.0
    assert results["planned_final_error_m"] < 5e-4
    assert 0.02 < results["mean_final_error_m"] < 0.4
    assert 0.5 < results["coverage_2_sigma"] <= 1.0
    with pytest.raises(OutputExistsError, match="--force"):
        build_reach_bundle(tmp_path / "reach", configurations=3, repeats=1)


def test_a_place_that_is_taken_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def simulate(*arguments: object, **options: object) -> None:
        raise AssertionError("simulated for nothing")

    monkeypatch.setattr("punnet.sim.reach_bundle.simulate_demonstrations", simulate)
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "one.jpg").write_bytes(b"")
    for name, force in (("photos", False), ("photos", True), ("reach.onnx", False)):
        with pytest.raises(OutputError):
            build_reach_bundle(tmp_path / name, force=force)


def test_too_few_configurations_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="at least 3"):
        build_reach_bundle(tmp_path / "reach", configurations=2)
