"""The thesis' own 25 targets: forward kinematics of the reconstructed reaches, and how far off a constant and a neighbour are.

    python benchmarks/thesis_demos.py ../shared/data/thesis_demos/annotation.zip [--plot reaches.png] [--json]

The annotation has no photographs and no boxes, so nothing that sees can be measured on it. Left out in turn: the mean of the
other 24 (``constant``), and the one of them that ends nearest, which is the best that copying a neighbour could do.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos import read_demos
from punnet.movement import GaussianBasis, ProMP
from punnet.robot import Panda

SAMPLES = 150


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("annotation", type=Path)
    parser.add_argument("--plot", type=Path)
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    episodes = [episode for episode in read_demos(asked.annotation) if episode.joints is not None]
    joints = np.array(
        [episode.joints.resampled(SAMPLES) for episode in episodes if episode.joints is not None]
    )
    arm, basis = Panda(), GaussianBasis()
    phases = np.linspace(0.0, 1.0, SAMPLES)
    again = np.array([basis.phi(phases) @ ProMP(basis).weights(path).T for path in joints])
    places, refitted = (arm.forward_kinematics(paths)[..., :3, 3] for paths in (joints, again))
    ends = places[:, -1]
    others = [np.delete(np.arange(len(joints)), row) for row in range(len(joints))]
    means = np.array([joints[rest, -1].mean(axis=0) for rest in others])
    constant = np.linalg.norm(arm.forward_kinematics(means)[:, :3, 3] - ends, axis=1)
    apart = np.linalg.norm(ends[:, None] - ends, axis=2)
    np.fill_diagonal(apart, np.inf)
    found = {
        "targets": len(joints),
        "refit_rms_rad": float(np.sqrt(np.square(again - joints).mean())),
        "refit_worst_m": float(np.linalg.norm(refitted - places, axis=2).max()),
        "ends_lowest_m": ends.min(axis=0).round(3).tolist(),
        "ends_highest_m": ends.max(axis=0).round(3).tolist(),
        "within_limits": int(arm.within_limits(joints).all(axis=1).sum()),
        "constant_m": float(constant.mean()),
        "nearest_end_m": float(apart.min(axis=1).mean()),
    }
    if asked.plot is not None:
        draw(places, asked.plot)
    if asked.json:
        print(json.dumps(found, indent=1))
    else:
        for name, value in found.items():
            print(f"{name}: {value:.4g}" if isinstance(value, float) else f"{name}: {value}")


def draw(places: NDArray[np.float64], path: Path) -> None:
    """Paths (N, T, 3) of the flange from above and from the side."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (row, column, name) in zip(
        figure.subplots(1, 2), ((1, 0, "x against y, m"), (0, 2, "z against x, m")), strict=True
    ):
        axes.plot(places[:, :, row].T, places[:, :, column].T, lw=0.9)
        axes.plot(places[:, -1, row], places[:, -1, column], "k.", ms=4)
        axes.set_title(name, fontsize=10)
        axes.set_aspect("equal")
        axes.grid(alpha=0.25)
    figure.savefig(path, dpi=100)


if __name__ == "__main__":
    main()
