"""Losses of the thesis, sections 5.3 and 5.4, without the T × T matrices.

With G = ΦᵀΦ and Δ the difference of two covariances of weights, ‖ΦΔΦᵀ‖²_F = tr(GΔGΔ): exact, and B² numbers in place
of T².
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from punnet.train.planner.config import Reconstruction

__all__ = ["endpoint_loss", "latent_divergence", "movement_loss", "reconstruction_loss"]


def movement_loss(
    mean: Tensor, factor: Tensor, true_mean: Tensor, true_covariance: Tensor, phi: Tensor, alpha: float
) -> Tensor:
    """Eq. 5.13, of each degree: (D,), the mean over movements, instants and pairs of instants.

    Parameters
    ----------
    mean, factor
        Predicted (N, D, B), and (N, D, B, B) with covariance F Fᵀ.
    true_mean, true_covariance
        (N, D, B) and (N, D, B, B).
    phi
        (T, B) basis.
    alpha
        α, between the two terms.
    """
    gram = phi.T @ phi
    T = phi.shape[0]
    off = mean - true_mean
    means = (off @ gram * off).sum(dim=-1) / T
    weighted = (
        factor @ factor.transpose(-1, -2) - true_covariance
    ) @ gram  # so it is one product for all movements
    covariances = (weighted * weighted.transpose(-1, -2)).sum(dim=(-2, -1)) / T**2
    return (means + alpha * covariances).mean(dim=0)


def endpoint_loss(
    mean: Tensor, factor: Tensor, true_mean: Tensor, true_covariance: Tensor, last: Tensor, alpha: float
) -> Tensor:
    """Eq. 5.17, of each degree: (D,); ``last`` (B,) is the basis at the final instant."""
    off = (mean - true_mean) @ last
    variance = (last @ factor).square().sum(-1) - torch.einsum("b,ndbc,c->nd", last, true_covariance, last)
    return (off.square() + alpha * variance.square()).mean(dim=0)


def reconstruction_loss(logits: Tensor, pictures: Tensor, kind: Reconstruction) -> Tensor:
    """Eq. 5.12: mean square over all values; or binary cross-entropy, summed over a picture."""
    if kind == "bce":
        summed = nn.functional.binary_cross_entropy_with_logits(logits, pictures, reduction="sum")
        return summed / len(pictures)
    return nn.functional.mse_loss(torch.sigmoid(logits), pictures)


def latent_divergence(mean: Tensor, log_variance: Tensor) -> Tensor:
    """KL(N(μ, Σ) ‖ N(0, I)) of Eq. 5.15, the mean over pictures."""
    terms = mean.square() + log_variance.exp() - 1.0 - log_variance
    return 0.5 * terms.sum(dim=-1).mean()
