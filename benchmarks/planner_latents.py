"""What the latent vector is worth to the MLPs of a cVAE: tr-2 on the vectors as they are, at a tenth, and at nothing.

    python benchmarks/planner_latents.py --data LEARNT --unseen OTHERS --runs runs/chapter-6 --quick [--json]

The encodings are those of ``punnet reproduce table-6-3`` with the same options, which have to be there or are made first. With
nothing of the vector left, the MLPs see the centre of the box alone. Told is how far the final position is off, metres, on the
photographs learnt from and on plants not seen.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from punnet.cli.console import whisper
from punnet.data.demos import read_demos
from punnet.planning.reaches import Reaches, reaches_from
from punnet.train.planner import PlannerConfig
from punnet.train.planner.chapter_6 import train_chapter
from punnet.train.planner.losses import movement_loss
from punnet.train.planner.network import DeepProMP

BATCH, RATE, EPOCHS, INSTANTS = 50, 5e-4, 300, 150
SHARES = (1.0, 0.1, 0.0)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--unseen", type=Path, required=True)
    parser.add_argument("--runs", type=Path, default=Path("runs/chapter-6"))
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    learnt, unseen = reaches_from(read_demos(asked.data)), reaches_from(read_demos(asked.unseen))
    folder = asked.runs / ("networks-quick" if asked.quick else "networks")
    chapter = train_chapter(
        learnt, unseen, folder=folder, seeds=[0], quick=asked.quick, workers=1, progress=whisper
    )
    encoded = chapter.outcomes["cvae-task"][0]
    found = []
    for share in SHARES:
        heads = train_heads(share * encoded.latents, learnt)
        row = {"share": share, "learnt_m": off(heads, share * encoded.latents, learnt)}
        found.append(row | {"unseen_m": off(heads, share * encoded.unseen_latents, unseen)})
        whisper(f"{found[-1]}")
    if asked.json:
        print(json.dumps(found, indent=1))
        return
    print("| latent vector times | learnt, m | unseen, m |\n| --- | ---: | ---: |")
    for row in found:
        print(f"| {row['share']:g} | {row['learnt_m']:.4f} | {row['unseen_m']:.4f} |")


def train_heads(latents: NDArray[np.float64], reaches: Reaches) -> DeepProMP:
    """tr-2 on these encodings, task space."""
    torch.manual_seed(0)
    network = DeepProMP(PlannerConfig(), reaches.basis.count)
    movements = reaches.pose
    network.heads.start_at(movements.mean.mean(axis=0), movements.blocks.mean(axis=0))
    optimizer = torch.optim.Adam(network.heads.parameters(), lr=RATE, foreach=True)
    phi = floats(reaches.basis.phi(np.linspace(0.0, 1.0, INSTANTS)))
    tensors = [
        floats(values)
        for values in (
            latents,
            reaches.centres,
            movements.mean[reaches.targets],
            movements.blocks[reaches.targets],
        )
    ]
    for _ in range(EPOCHS):
        for rows in torch.randperm(len(latents)).split(BATCH):
            seen, centres, mean, covariance = (values[rows] for values in tensors)
            loss = movement_loss(*network.heads(seen, centres), mean, covariance, phi, 1.0).sum()
            optimizer.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimizer.step()
    return network


@torch.no_grad()
def off(network: DeepProMP, latents: NDArray[np.float64], reaches: Reaches) -> float:
    """Mean error of the final position."""
    last = reaches.basis.phi([1.0])[0]
    mean, _ = network.heads(floats(latents), floats(reaches.centres))
    ends = mean.double().numpy() @ last - (reaches.pose.mean @ last)[reaches.targets]
    return float(np.linalg.norm(ends[:, :3], axis=1).mean())


def floats(values: NDArray[np.float64]) -> torch.Tensor:
    return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float32))


if __name__ == "__main__":
    main()
