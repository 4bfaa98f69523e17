"""Planners as ONNX graphs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from punnet.errors import BundleError, ShapeError
from punnet.planning.learned import MovementModel
from punnet.planning.reaches import reaches_from
from punnet.train.planner import DeepPrediction, PlannerConfig
from punnet.train.planner.export import export_planner
from punnet.train.planner.full import FullConfig, fit_full
from punnet.train.planner.network import DeepProMP


@pytest.mark.parametrize("kind", ["direct", "cvae"])
def test_a_networks_graph_gives_what_the_network_gives(kind, reach_demonstrations, tmp_path: Path) -> None:
    reaches = reaches_from(reach_demonstrations)
    torch.manual_seed(3)
    network = DeepProMP(PlannerConfig(kind=kind, space="joint", trunk=((32, 16),))).eval()
    prediction = DeepPrediction(network)
    export_planner(prediction, tmp_path / "n.onnx")
    model = MovementModel(tmp_path / "n.onnx", "n", "joint", reaches.basis)
    assert model.needs_picture
    found, wanted = model.predict(reaches), prediction.predict(reaches)
    # Weights are stored in half precision.
    np.testing.assert_allclose(found.mean, wanted.mean, atol=2e-3)
    np.testing.assert_allclose(found.covariance, wanted.covariance, atol=5e-3)


def test_fulls_graph_gives_what_full_gives(reach_demonstrations, tmp_path: Path) -> None:
    reaches = reaches_from(reach_demonstrations)
    fitted = fit_full(FullConfig(), reaches)
    export_planner(fitted, tmp_path / "f.onnx")
    model = MovementModel(tmp_path / "f.onnx", "f", "task", reaches.basis)
    assert not model.needs_picture
    found, wanted = model.predict(reaches), fitted.predict(reaches)
    np.testing.assert_allclose(found.mean, wanted.mean, atol=3e-5)  # box and light are in single precision
    np.testing.assert_allclose(found.covariance, wanted.covariance, atol=1e-6)
    with pytest.raises(ShapeError, match="boxes"):
        model.movements(reaches.pictures[:2], reaches.boxes[:3], reaches.lights[:3])


def test_fulls_graph_looks_at_the_light_where_it_is_known(reach_demonstrations, tmp_path: Path) -> None:
    reaches = reaches_from(reach_demonstrations)
    far = reaches.pose.mean @ reaches.basis.phi([1.0])[0]
    centres = reaches.centres
    reaches = replace(reaches, boxes=np.column_stack((centres - 0.05, centres + 0.05)))
    lit = replace(reaches, lights=1.0 - 5.0 * far[reaches.targets, 0])  # tells how far away the berry is
    fitted = fit_full(FullConfig(), lit)
    assert fitted.closer is not None
    assert "light" in fitted.closer.cues
    assert fitted.left_out["position_m"] < 0.8 * fit_full(FullConfig(), reaches).left_out["position_m"]
    export_planner(fitted, tmp_path / "f.onnx")
    model = MovementModel(tmp_path / "f.onnx", "f", "task", reaches.basis)
    assert not model.needs_picture
    some = replace(lit, lights=np.where(np.arange(len(lit)) % 2, lit.lights, np.nan))
    found, wanted = model.predict(some), fitted.predict(some)
    np.testing.assert_allclose(found.mean, wanted.mean, atol=1e-5)
    np.testing.assert_allclose(found.covariance, wanted.covariance, atol=1e-7)
    blind = fitted.predict(replace(lit, lights=np.full(len(lit), np.nan)))
    np.testing.assert_allclose(wanted.mean[::2], blind.mean[::2])


def test_another_graph_is_refused(tmp_path: Path) -> None:
    torch.onnx.export(torch.nn.Linear(2, 3), (torch.zeros(1, 2),), str(tmp_path / "x.onnx"), dynamo=False)
    with pytest.raises(BundleError, match="not a planner's graph"):
        MovementModel(tmp_path / "x.onnx", "x", "task", None)
    (tmp_path / "y.onnx").write_bytes(b"no graph")
    with pytest.raises(BundleError, match="can't be loaded"):
        MovementModel(tmp_path / "y.onnx", "y", "task", None)
