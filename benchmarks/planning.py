"""Training and inference of learned planners against the way the thesis' code works, in one run.

    python benchmarks/planning.py [--bundle reach-sim] [--json]

Training: tr-2 of a cVAE (the seven MLPs), 250 photographs, batches of 50, photographs a second through all seven.

* ours: encodings cached, seven MLPs as one batched module, the covariance term of Eq. 5.13 as tr(GΔGΔ);
* faithful: one network after another, each seeing the pictures through the frozen encoder, with T×T covariances of 150
  instants; the same layers, loss and optimiser in the same framework.

Both losses are first held against each other on one batch. Inference: a bundle's distribution of one 1280×720 photograph, from
decoded picture to `TrajectoryDistribution`. Medians; threads as they come.
"""

from __future__ import annotations

import argparse
import json
import platform
import time
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor, nn

from punnet.movement import GaussianBasis
from punnet.planning import DeepProMPPlanner
from punnet.scene import Frame, Target
from punnet.train.planner import PlannerConfig
from punnet.train.planner.autoencoder import SLOPE, Encoder
from punnet.train.planner.heads import BatchedHeads, covariance_factor
from punnet.train.planner.losses import movement_loss
from punnet.train.planner.network import DeepProMP, as_input

PHOTOGRAPHS, BATCH, DEGREES, FUNCTIONS, INSTANTS = 250, 50, 7, 8, 150
RATE = 1e-4
TURNS = 3
BARS = {"training": 20.0, "inference_ms": 5.0}


class OneMLP(nn.Module):
    """The conditioned MLP of one degree of freedom as figure A.6 draws it, layer by layer."""

    def __init__(self, batched: BatchedHeads, degree: int) -> None:
        super().__init__()
        self.trunk, self.conditions = _copied(batched.trunk, degree), _copied(batched.conditions, degree)
        self.mean = _copied(batched.mean_branch, degree)
        self.covariance = _copied(batched.covariance_branch, degree)

    def forward(self, latent: Tensor, centres: Tensor) -> tuple[Tensor, Tensor]:
        """(N, 8) and (N, 36)."""
        for layer in self.trunk:
            latent = nn.functional.leaky_relu(layer(latent), SLOPE)
        told = [
            nn.functional.leaky_relu(layer(centres[:, [i]]), SLOPE) for i, layer in enumerate(self.conditions)
        ]
        values = torch.cat((latent, *told), dim=1)
        return _branch(self.mean, values), _branch(self.covariance, values)


def _copied(layers: nn.ModuleList, degree: int) -> nn.ModuleList:
    made = []
    for layer in layers:
        weight, bias = layer.weight.detach()[degree], layer.bias.detach()[degree, 0]
        linear = nn.Linear(*weight.shape)
        linear.weight.data, linear.bias.data = weight.T.clone(), bias.clone()
        made.append(linear)
    return nn.ModuleList(made)


def _branch(layers: nn.ModuleList, values: Tensor) -> Tensor:
    for layer in layers[:-1]:
        values = torch.tanh(layer(values))
    return layers[-1](values)


def whole_loss(mean: Tensor, entries: Tensor, true: Tensor, covariance: Tensor, phi: Tensor) -> Tensor:
    """Eq. 5.13 of one degree of freedom with its T×T matrices."""
    factor = covariance_factor(entries, FUNCTIONS)
    means = ((mean - true) @ phi.T).square().mean()
    found = phi @ (factor @ factor.transpose(1, 2)) @ phi.T
    return means + (found - phi @ covariance @ phi.T).square().mean()


class Work:
    """Random photographs and movements, and one network's weights for both ways."""

    def __init__(self) -> None:
        torch.manual_seed(0)
        self.pictures = torch.randint(0, 256, (PHOTOGRAPHS, 128, 128, 3), dtype=torch.uint8)
        self.centres = torch.rand(PHOTOGRAPHS, 2)
        self.mean = torch.randn(PHOTOGRAPHS, DEGREES, FUNCTIONS)
        root = 0.1 * torch.randn(PHOTOGRAPHS, DEGREES, FUNCTIONS, FUNCTIONS)
        self.covariance = root @ root.transpose(2, 3)
        self.phi = torch.from_numpy(GaussianBasis().phi(np.linspace(0, 1, INSTANTS))).float()
        self.network = DeepProMP(PlannerConfig(kind="cvae"), FUNCTIONS).eval()
        self.batches = list(torch.arange(PHOTOGRAPHS).split(BATCH))

    def ours(self) -> Callable[[], float]:
        """One pass over the photographs; the encodings' computing is part of the first."""
        heads = self.network.heads
        adam = torch.optim.Adam(heads.parameters(), lr=RATE, fused=True)
        with torch.no_grad():
            latents = torch.cat(
                [self.network.encoder(as_input(self.pictures[rows])) for rows in self.batches]
            )

        def epoch() -> float:
            for rows in self.batches:
                adam.zero_grad()
                found, factor = heads(latents[rows], self.centres[rows])
                movement_loss(
                    found, factor, self.mean[rows], self.covariance[rows], self.phi, 1.0
                ).sum().backward()
                adam.step()
            return PHOTOGRAPHS

        return epoch

    def faithful(self) -> Callable[[], float]:
        """One pass over the photographs for each degree of freedom."""
        encoder: Encoder = self.network.encoder
        networks = [OneMLP(self.network.heads.heads[0], degree) for degree in range(DEGREES)]
        optimisers = [torch.optim.Adam(network.parameters(), lr=RATE, fused=True) for network in networks]

        def epoch() -> float:
            for degree, (network, adam) in enumerate(zip(networks, optimisers, strict=True)):
                for rows in self.batches:
                    adam.zero_grad()
                    with torch.no_grad():
                        latent = encoder(as_input(self.pictures[rows]))
                    found = network(latent, self.centres[rows])
                    whole_loss(
                        *found, self.mean[rows, degree], self.covariance[rows, degree], self.phi
                    ).backward()
                    adam.step()
            return PHOTOGRAPHS

        return epoch

    def apart(self) -> float:
        """Largest relative difference of the two ways' losses on one batch."""
        rows = self.batches[0]
        with torch.no_grad():
            latent = self.network.encoder(as_input(self.pictures[rows]))
            found, factor = self.network.heads(latent, self.centres[rows])
            ours = movement_loss(found, factor, self.mean[rows], self.covariance[rows], self.phi, 1.0)
            theirs = torch.stack(
                [
                    whole_loss(
                        *OneMLP(self.network.heads.heads[0], degree)(latent, self.centres[rows]),
                        self.mean[rows, degree],
                        self.covariance[rows, degree],
                        self.phi,
                    )
                    for degree in range(DEGREES)
                ]
            )
        return float(((ours - theirs).abs() / theirs).max())


def throughput(epoch: Callable[[], float], seconds: float) -> float:
    """Photographs a second."""
    epoch()
    done, begun = 0.0, time.perf_counter()
    while time.perf_counter() - begun < seconds:
        done += epoch()
    return done / (time.perf_counter() - begun)


def inference(source: str) -> float:
    """Median milliseconds of one distribution."""
    planner = DeepProMPPlanner.from_bundle(source)
    frame = Frame(rgb=np.random.default_rng(0).integers(0, 256, (720, 1280, 3), dtype=np.uint8))
    target = Target(box=np.array([600.0, 300.0, 660.0, 380.0]))
    spent = []
    for _ in range(100):
        begun = time.perf_counter()
        planner.distribution(frame, target)
        spent.append(time.perf_counter() - begun)
    return 1e3 * float(np.median(spent))


def main() -> None:
    """Measure, print, and exit with 1 where a bar is missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--bundle", action="append", help="planner bundles to time; by default both of reach-sim's models"
    )
    parser.add_argument("--seconds", type=float, default=5.0, help="of each measurement of training")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    work = Work()
    ways = {"ours": work.ours(), "faithful": work.faithful()}
    rates = {name: [] for name in ways}
    for _ in range(TURNS):
        for name, epoch in ways.items():
            rates[name].append(throughput(epoch, args.seconds))
    ratio = float(np.median(rates["ours"]) / np.median(rates["faithful"]))
    times = {source: inference(source) for source in args.bundle or ["reach-sim", "reach-sim:l-cvae-task"]}
    result = {
        "machine": f"{platform.machine()}, {torch.get_num_threads()} threads, torch {torch.__version__}",
        "losses_apart": work.apart(),
        "photographs_a_second": {name: float(np.median(values)) for name, values in rates.items()},
        "training_ratio": ratio,
        "inference_ms": times,
        "bars": BARS,
    }
    if args.json:
        print(json.dumps(result, indent=1))
    else:
        print(f"losses of both ways: {result['losses_apart']:.1e} apart")
        print(f"tr-2: {ratio:.0f} times the faithful way's photographs a second (bar {BARS['training']:.0f})")
        for source, spent in times.items():
            print(f"{source}: {spent:.1f} ms a distribution (bar {BARS['inference_ms']:.0f})")
    if ratio < BARS["training"] or max(times.values()) > BARS["inference_ms"]:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
