"""Autoencoders in Keras' layout. The golden values are Keras' own, of weights that are drawn here as they were there."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from punnet.errors import ConfigurationError
from punnet.train.planner.keras_arrays import from_keras_arrays

GOLDEN = json.loads((Path(__file__).parent / "golden" / "keras_vae.json").read_text())


def drawn() -> dict[str, Any]:
    """The golden model's weights by name."""
    rng = np.random.default_rng(5)
    arrays = {}
    for name, shape in GOLDEN["names"]:
        scale = 1.0 / np.sqrt(max(1, np.prod(shape[:-1]))) if len(shape) > 1 else 0.1
        values = rng.normal(size=shape) * scale
        arrays[name] = 1.0 + np.abs(values) if "variance" in name or "gamma" in name else values
    return arrays


@torch.no_grad()
def test_outputs_are_those_of_keras() -> None:
    encoder, decoder = from_keras_arrays(drawn())
    assert decoder is not None
    picture = (np.arange(128 * 128 * 3).reshape(1, 128, 128, 3) * 7919 % 256).astype(np.float32) / 255
    seen = torch.from_numpy(picture).permute(0, 3, 1, 2)
    mean, log_variance = encoder.distribution(seen)
    np.testing.assert_allclose(mean[0, ::32], GOLDEN["mean"], atol=1e-4)
    np.testing.assert_allclose(log_variance[0, ::32], GOLDEN["log_variance"], atol=1e-4)
    made = torch.sigmoid(decoder(mean)).permute(0, 2, 3, 1)
    np.testing.assert_allclose(made[0, ::31, ::37].ravel(), GOLDEN["picture"], atol=1e-4)


def test_names_of_another_session_and_an_encoder_alone() -> None:
    arrays = {
        f"vae/encoder/{name.replace('conv2d', 'conv2d_9') if name.startswith('conv2d/') else name}:0": values
        for name, values in drawn().items()
        if not ("transpose" in name or name.startswith("dense/"))
        and not any(name.startswith(f"batch_normalization_{number}/") for number in (3, 4, 5, 6))
    }
    renamed = {
        name.replace("conv2d_1/", "conv2d_10/").replace("conv2d_2/", "conv2d_11/"): v
        for name, v in arrays.items()
    }
    encoder, decoder = from_keras_arrays(renamed)
    assert decoder is None
    whole, _ = from_keras_arrays(drawn())
    for name, values in whole.state_dict().items():
        torch.testing.assert_close(encoder.state_dict()[name], values)


def test_what_does_not_fit_is_named() -> None:
    arrays = drawn()
    with pytest.raises(ConfigurationError, match="not the autoencoder"):
        from_keras_arrays({name: v for name, v in arrays.items() if not name.startswith("conv2d_2/")})
    with pytest.raises(ConfigurationError, match="'conv2d_1/bias' is missing"):
        from_keras_arrays({name: v for name, v in arrays.items() if name != "conv2d_1/bias"})
    with pytest.raises(ConfigurationError, match=r"conv2d/kernel.*another shape"):
        from_keras_arrays({**arrays, "conv2d/kernel": np.zeros((7, 7, 3, 32))})
    with pytest.raises(ConfigurationError, match="no weight's name"):
        from_keras_arrays({"kernel": np.zeros(3)})
