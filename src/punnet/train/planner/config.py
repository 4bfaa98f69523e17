"""What a deep-ProMP is made of and how it is trained."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Literal, get_args

from punnet.errors import ConfigurationError
from punnet.movement.distribution import Space

__all__ = ["KINDS", "QUICK", "Kind", "PlannerConfig", "Reconstruction"]

Kind = Literal["direct", "ae", "vae", "cvae"]
Reconstruction = Literal["mse", "bce"]
KINDS: tuple[Kind, ...] = get_args(Kind)


@dataclass(frozen=True)
class PlannerConfig:
    """One learned planner: which network, which space, how it is trained (thesis chapter 5, appendix A).

    Parameters
    ----------
    kind
        ``direct``: encoder and MLPs trained at once; ``ae``, ``vae``: MLPs on the latent vector of an autoencoder, plain
        or variational; ``cvae``: also told the centre of the target's box.
    space
        ``joint``: seven joints; ``task``: position and quaternion.
    tuned
        Whether the encoder is tuned by the error at the final instant (Eq. 5.17).
    trunk
        Widths (512, 256) of each MLP's trunk: one pair for all seven, or seven pairs.
    alpha
        α of Eq. 5.13 and 5.17.
    reconstruction
        Of tr-1: ``mse`` (Eq. 5.12, 5.15), or ``bce``, summed over a picture as in the lab's code.
    learning_rate, tuning_rate
        Adam's; the tuning's own, since a high one throws the encoder off what the MLPs know.
    reconstruction_epochs, epochs, tuning_epochs
        Of tr-1, tr-2 and the tuning.
    sampled_latents
        Show the MLPs latent vectors drawn from the variational encoder's distribution, not its mean: they learn less by heart.
    batch, mlp_batch
        Photographs a step of what sees pictures, and of tr-2 on cached encodings.
    schedule_factor, schedule_patience
        The rate is multiplied by the factor after so many epochs without a lower loss.
    """

    kind: Kind = "cvae"
    space: Space = "task"
    tuned: bool = True
    trunk: tuple[tuple[int, int], ...] = ((512, 256),)
    alpha: float = 1.0
    reconstruction: Reconstruction = "mse"
    learning_rate: float = 1e-4
    tuning_rate: float = 1e-4
    reconstruction_epochs: int = 250
    epochs: int = 3000
    tuning_epochs: int = 250
    sampled_latents: bool = False
    batch: int = 16
    mlp_batch: int = 50
    schedule_factor: float = 0.99
    schedule_patience: int = 5

    def __post_init__(self) -> None:
        for name, values in (
            ("kind", KINDS),
            ("space", get_args(Space)),
            ("reconstruction", get_args(Reconstruction)),
        ):
            if getattr(self, name) not in values:
                raise ConfigurationError(
                    f"planner: {name} must be one of {', '.join(values)}, got {getattr(self, name)!r}"
                )
        object.__setattr__(self, "trunk", tuple(tuple(pair) for pair in self.trunk))
        if len(self.trunk) not in (1, 7) or any(len(pair) != 2 or min(pair) < 1 for pair in self.trunk):
            raise ConfigurationError(f"planner: trunk must be one or seven pairs of widths, got {self.trunk}")
        if self.sampled_latents and not self.variational:
            raise ConfigurationError(
                f"planner: sampled_latents needs a variational encoder, which {self.kind} has not"
            )
        for item in dataclasses.fields(self):
            value = getattr(self, item.name)
            if isinstance(value, bool) or not isinstance(value, int | float):
                continue
            least = 0 if item.name in ("alpha", "reconstruction_epochs", "tuning_epochs") else math.ulp(0.0)
            if not least <= value < math.inf:
                raise ConfigurationError(f"planner: {item.name} must be positive, got {value}")

    @property
    def name(self) -> str:
        """Kind and space, ``l-`` before it if tuned, as the thesis calls it."""
        tuned = "l-" if self.tuned and self.kind != "direct" else ""
        return f"{tuned}{self.kind}-{self.space}"

    @property
    def conditioned(self) -> bool:
        """Whether the MLPs are told the box's centre."""
        return self.kind == "cvae"

    @property
    def variational(self) -> bool:
        """Whether the encoder gives a distribution."""
        return self.kind in ("vae", "cvae")


QUICK = {
    "reconstruction_epochs": 40,
    "epochs": 600,
    "tuning_epochs": 20,
    "learning_rate": 5e-4,
    "schedule_patience": 20,
}
"""Settings of a short training: fewer epochs, a higher rate."""
