"""The networks of appendix A."""

import numpy as np
import pytest
import torch

from punnet.train.planner.autoencoder import Decoder, Encoder
from punnet.train.planner.heads import BatchedHeads, MovementHeads, covariance_factor
from punnet.train.planner.losses import endpoint_loss, latent_divergence, movement_loss, reconstruction_loss


def count(module: torch.nn.Module) -> int:
    """As Keras counts: batch normalisation's statistics too."""
    buffers = [b for name, b in module.named_buffers() if "running" in name]
    return sum(p.numel() for p in [*module.parameters(), *buffers])


@pytest.mark.parametrize(
    ("module", "parameters"),
    [
        (Encoder(variational=False), 227_008),
        (Encoder(variational=True), 358_336),
        (Decoder(), 418_403),
        (BatchedHeads(1, 8, (512, 256), conditioned=False), 350_300),
        (BatchedHeads(1, 8, (512, 256), conditioned=True), 350_816),
    ],
)
def test_parameter_counts_are_those_of_the_appendix(module: torch.nn.Module, parameters: int) -> None:
    assert count(module) == parameters


def test_shapes_of_the_appendix() -> None:
    encoder, decoder = Encoder(variational=True).eval(), Decoder().eval()
    pictures = torch.rand(2, 3, 128, 128)
    shapes = []
    values = pictures
    for block in encoder.blocks:
        values = block(values)
        shapes.append(tuple(values.shape[1:]))
    assert shapes == [(32, 32, 32), (64, 8, 8), (128, 2, 2)]
    assert encoder(pictures).shape == (2, 256)
    assert decoder(torch.zeros(2, 256)).shape == (2, 3, 128, 128)


@pytest.mark.parametrize("conditioned", [False, True])
def test_heads_of_one_batch_share_nothing(conditioned: bool) -> None:
    torch.manual_seed(0)
    heads = MovementHeads(7, 8, ((512, 256),), conditioned=conditioned)
    latent, centres = torch.randn(3, 256), torch.rand(3, 2)
    mean, factor = heads(latent, centres)
    single = BatchedHeads(1, 8, (512, 256), conditioned=conditioned)
    for degree in range(7):
        state = {name: value[degree : degree + 1] for name, value in heads.heads[0].state_dict().items()}
        single.load_state_dict(state)
        alone_mean, alone_entries = single(latent, centres)
        torch.testing.assert_close(mean[:, degree], alone_mean[0])
        torch.testing.assert_close(factor[:, degree], covariance_factor(alone_entries[0], 8))


def test_degrees_may_have_trunks_of_their_own() -> None:
    trunk = ((64, 32), (16, 8), (64, 32), (64, 32), (16, 8), (64, 32), (4, 4))
    heads = MovementHeads(7, 8, trunk, conditioned=False)
    start = np.arange(56.0).reshape(7, 8)
    heads.start_at(start, np.tile(np.eye(8), (7, 1, 1)))
    for head in heads.heads:
        for layer in head.trunk:
            torch.nn.init.zeros_(layer.weight)
        for branch in (head.mean_branch, head.covariance_branch):
            torch.nn.init.zeros_(branch[-1].weight)
    mean, _ = heads(torch.randn(2, 256), torch.zeros(2, 2))
    np.testing.assert_allclose(mean[0].detach().numpy(), start)


def test_the_factor_is_that_of_ldl() -> None:
    entries = torch.randn(36, dtype=torch.float64)
    L, D = np.eye(8), np.diag(np.exp(entries[28:].numpy()))
    L[np.tril_indices(8, -1)] = entries[:28].numpy()
    F = covariance_factor(entries, 8).numpy()
    np.testing.assert_allclose(F @ F.T, L @ D @ L.T, atol=1e-6)
    assert np.linalg.eigvalsh(F @ F.T).min() > 0


def test_losses_are_those_in_trajectory_space() -> None:
    generator = torch.Generator().manual_seed(1)
    N, D, B, T = 3, 7, 8, 150
    phi = torch.rand(T, B, generator=generator, dtype=torch.float64)
    mean, true = (torch.randn(N, D, B, generator=generator, dtype=torch.float64) for _ in range(2))
    factor, other = (torch.randn(N, D, B, B, generator=generator, dtype=torch.float64) for _ in range(2))
    covariance = other @ other.transpose(-1, -2)
    trajectories = (mean - true) @ phi.T
    difference = phi @ (factor @ factor.transpose(-1, -2) - covariance) @ phi.T
    wanted = (trajectories.square().mean(-1) + 0.7 * difference.square().mean((-1, -2))).mean(0)
    torch.testing.assert_close(movement_loss(mean, factor, true, covariance, phi, 0.7), wanted)
    last = (trajectories[..., -1].square() + 0.7 * difference[..., -1, -1].square()).mean(0)
    torch.testing.assert_close(endpoint_loss(mean, factor, true, covariance, phi[-1], 0.7), last)


def test_divergence_and_reconstruction() -> None:
    mean, log_variance = torch.tensor([[1.0, 0.0]]), torch.tensor([[0.0, np.log(4.0)]], dtype=torch.float32)
    normal = torch.distributions.Normal
    wanted = torch.distributions.kl_divergence(
        normal(mean, torch.exp(0.5 * log_variance)), normal(0.0, 1.0)
    ).sum()
    torch.testing.assert_close(latent_divergence(mean, log_variance), wanted)
    logits, pictures = torch.randn(2, 3, 4, 4), torch.rand(2, 3, 4, 4)
    p = torch.sigmoid(logits)
    torch.testing.assert_close(reconstruction_loss(logits, pictures, "mse"), (p - pictures).square().mean())
    entropy = -(pictures * p.log() + (1 - pictures) * (1 - p).log()).sum() / 2
    torch.testing.assert_close(reconstruction_loss(logits, pictures, "bce"), entropy, rtol=1e-4, atol=1e-3)
