"""Encoders and decoder of appendix A.1 and A.2: figures A.1 to A.4, layer by layer, with TensorFlow's padding."""

from __future__ import annotations

import torch
from torch import Tensor, nn

__all__ = ["LATENT", "Decoder", "Encoder"]

LATENT = 256
"""Length of the latent vector."""
SLOPE = 0.2
EPSILON, MOMENTUM = 1e-3, 0.01  # Keras' momentum of .99 is PyTorch's of .01


class SameConvolution(nn.Conv2d):
    """Strided convolution with "same" padding as TensorFlow does it: what is odd goes right and below."""

    def forward(self, input: Tensor) -> Tensor:  # noqa: A002 — PyTorch's own name
        kernel, stride = self.kernel_size[0], self.stride[0]
        size = input.shape[-1]
        total = max((-(-size // stride) - 1) * stride + kernel - size, 0)
        before = total // 2
        padded = nn.functional.pad(input, (before, total - before, before, total - before))
        return super().forward(padded)


class SameTransposed(nn.ConvTranspose2d):
    """Transposed convolution whose output is ``stride`` times as large, cut as TensorFlow cuts it."""

    def forward(self, input: Tensor, output_size: list[int] | None = None) -> Tensor:  # noqa: A002
        whole = super().forward(input, output_size)
        before = max(self.kernel_size[0] - self.stride[0], 0) // 2
        size = input.shape[-1] * self.stride[0]
        return whole[..., before : before + size, before : before + size]


def _block(inputs: int, outputs: int, kernel: int) -> nn.Sequential:
    """Convolution, max-pooling, LeakyReLU, batch normalisation, in that order."""
    return nn.Sequential(
        SameConvolution(inputs, outputs, kernel, stride=2),
        nn.MaxPool2d(2),
        nn.LeakyReLU(SLOPE),
        nn.BatchNorm2d(outputs, eps=EPSILON, momentum=MOMENTUM),
    )


class Encoder(nn.Module):
    """Picture (N, 3, 128, 128) in [0, 1] to a latent vector (N, 256); Eq. 5.9.

    Parameters
    ----------
    variational
        Give the mean and the logarithm of the variance (Eq. 5.14).
    """

    def __init__(self, *, variational: bool) -> None:
        super().__init__()
        self.blocks = nn.Sequential(_block(3, 32, 5), _block(32, 64, 3), _block(64, 128, 3))
        self.bottleneck = nn.Linear(512, LATENT)
        self.log_variance = nn.Linear(512, LATENT) if variational else None

    def features(self, pictures: Tensor) -> Tensor:
        """Flattened as Keras does, channels last: (N, 512)."""
        maps: Tensor = self.blocks(pictures)
        return maps.permute(0, 2, 3, 1).flatten(1)

    def forward(self, pictures: Tensor) -> Tensor:
        """The latent vector, or its mean."""
        latent: Tensor = self.bottleneck(self.features(pictures))
        return latent

    def distribution(self, pictures: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and log variance, (N, 256) each, of a variational encoder."""
        assert self.log_variance is not None
        features = self.features(pictures)
        return self.bottleneck(features), self.log_variance(features)


class Decoder(nn.Module):
    """Latent vector (N, 256) to the logits of a picture (N, 3, 128, 128); figures A.2 and A.4."""

    def __init__(self) -> None:
        super().__init__()
        self.dense = nn.Linear(LATENT, 512)
        self.blocks = nn.Sequential(
            SameTransposed(128, 128, 3, stride=2),
            nn.Upsample(scale_factor=2),
            nn.LeakyReLU(SLOPE),
            nn.BatchNorm2d(128, eps=EPSILON, momentum=MOMENTUM),
            SameTransposed(128, 64, 3, stride=2),
            nn.Upsample(scale_factor=2),
            nn.LeakyReLU(SLOPE),
            nn.BatchNorm2d(64, eps=EPSILON, momentum=MOMENTUM),
            SameTransposed(64, 32, 5, stride=2),
            nn.LeakyReLU(SLOPE),
            nn.BatchNorm2d(32, eps=EPSILON, momentum=MOMENTUM),
            SameTransposed(32, 16, 5, stride=2),
            nn.LeakyReLU(SLOPE),
            nn.BatchNorm2d(16, eps=EPSILON, momentum=MOMENTUM),
            SameTransposed(16, 3, 3, stride=1),
        )

    def forward(self, latent: Tensor) -> Tensor:
        """Logits; their sigmoid is the picture."""
        maps = self.dense(latent).unflatten(1, (2, 2, 128)).permute(0, 3, 1, 2)
        picture: Tensor = self.blocks(maps)
        return picture


def sampled(mean: Tensor, log_variance: Tensor) -> Tensor:
    """A draw from the latent distribution, through which gradients flow."""
    return mean + torch.randn_like(mean) * torch.exp(0.5 * log_variance)
