"""The figure of docs/weight.md: the cloud of a simulated berry beside the one real cloud, and the weight of both.

    python benchmarks/weight_cloud.py --simulated DATASET-1 --real ../shared/data/dyson --out docs/figures/weight-cloud.png

The real cloud (Dyson-Lincoln set, berry 031, view 1; CC BY-NC-SA, not part of this project) is a list of points: x and y
were back-projected with a focal length of 320 pixels, every third row of which is empty, where the camera has about
615. The pixels are found again from that; the mask is what the points cover. The set tells the weight of the same
berry under another view: 23.3 g.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from punnet.data import read_dataset
from punnet.geometry import CameraIntrinsics
from punnet.scene import Frame, Strawberries
from punnet.weight import BerryObservation, observe
from punnet.weight.choosing import load_weight_estimator

LATTICE, FOCAL = 320.0, 615.0
REAL_FILE, REAL_GRAMS = "pointcloud_031_1.npz", 23.3
MARGIN = 20


@dataclass(frozen=True, eq=False)
class Sight:
    """A frame with one berry, and what it weighs."""

    title: str
    frame: Frame
    berries: Strawberries
    grams: float

    def observe(self) -> BerryObservation:
        """What the frame shows of the berry."""
        seen = observe(self.frame, self.berries)[0]
        if isinstance(seen, str):
            raise SystemExit(f"{self.title}: {seen}")
        return seen


def real_sight(folder: Path) -> Sight:
    """The real cloud as the frame that it came from."""
    with np.load(folder / REAL_FILE) as stored:
        points, colours = stored["xyz"].astype(np.float64), stored["rgb"]
    depth = -points[:, 2]
    pixels = np.rint(points[:, :2] / depth[:, None] * LATTICE).astype(int)
    first = pixels.min(axis=0) - MARGIN
    columns, rows = (pixels - first).T
    width, height = int(columns.max()) + MARGIN, int(rows.max()) + MARGIN
    rgb = np.zeros((height, width, 3), np.uint8)
    metres = np.zeros((height, width), np.float32)
    rgb[rows, columns], metres[rows, columns] = colours, depth / 1000.0
    covered = cv2.morphologyEx((metres > 0).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8)) > 0
    camera = CameraIntrinsics(width, height, FOCAL, FOCAL, float(-first[0]), float(-first[1]))
    berry = Strawberries((height, width), np.zeros((1, 4)), masks=np.asarray(covered)[None])
    return Sight("real, D435i", Frame(rgb, metres, camera), berry, REAL_GRAMS)


def simulated_sight(folder: Path, like: BerryObservation) -> Sight:
    """The free berry of a data set that is seen from about as near as ``like`` and of about its weight."""
    dataset = read_dataset(folder)
    found = []
    for image in dataset:
        for row, berry in enumerate(a for a in image.annotations if not a.crowd):
            if berry.keypoint_depths is None or not np.isfinite(berry.keypoint_depths).all():
                continue
            if berry.class_index == 0 and berry.occlusion < 0.01:
                off = abs(float(np.median(berry.keypoint_depths)) / like.distance - 1.0)
                found.append((off + abs(berry.weight / REAL_GRAMS - 1.0), image.id, image, row))
    for _, _, image, row in sorted(found, key=lambda item: item[:2]):
        berries = image.berries()[row]
        sight = Sight(
            "simulated",
            image.frame(),
            berries.with_fields(keypoints=None, visibility=None),
            float(berries.weights[0]),
        )
        seen = observe(sight.frame, sight.berries)[0]
        if isinstance(seen, BerryObservation) and seen.hidden < 0.25:
            return sight
    raise SystemExit(f"{folder}: no free berry that could be compared")


def layers_and_holes(berry: BerryObservation) -> tuple[int, float, float]:
    """Distinct depths that hold a hundredth of the points each; steps between them, metres; share without reading.

    Rows in which there is no reading at all are not counted as holes: that is how the real file was written.
    """
    depths, counts = np.unique(np.round(berry.cloud[:, 2], 4), return_counts=True)
    depths = depths[counts >= 0.01 * len(berry.cloud)]
    read = berry.mask & (berry.depth > 0)
    rows = read.any(axis=1)
    inside = berry.mask[rows].sum()
    return len(depths), float(np.median(np.diff(depths))), 1.0 - read[rows].sum() / inside


def draw(sights: list[Sight], out: Path) -> None:
    """Front and side of each cloud, to one scale."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        1, 2 * len(sights), figsize=(10, 4.4), width_ratios=[1.0, 0.55] * len(sights), sharey=True
    )
    for number, sight in enumerate(sights):
        berry = sight.observe()
        points = 1000.0 * (berry.cloud - [*berry.cloud[:, :2].mean(axis=0), berry.cloud[:, 2].min()])
        front, side = axes[2 * number : 2 * number + 2]
        front.scatter(
            points[:, 0], points[:, 1], c=points[:, 2], s=1.5, cmap="viridis", vmin=0, vmax=16, linewidths=0
        )
        side.scatter(
            points[:, 2], points[:, 1], c=points[:, 2], s=1.5, cmap="viridis", vmin=0, vmax=16, linewidths=0
        )
        layers, step, holes = layers_and_holes(berry)
        front.set_title(
            f"{sight.title}, {berry.distance:.2f} m away: {len(points)} points", fontsize=9, loc="left"
        )
        side.set_title(f"{layers} layers, {1000 * step:.0f} mm apart", fontsize=9, loc="left")
        front.set_xlabel(f"mm across; {100 * holes:.0f}% of the mask without a reading", fontsize=8)
        side.set_xlabel("mm in depth", fontsize=8)
        front.set_xlim(-21, 21)
        side.set_xlim(-2, 22)
        for axis in (front, side):
            axis.set_aspect("equal")
            axis.spines[["top", "right"]].set_visible(False)
            axis.tick_params(labelsize=8)
    axes[0].set_ylim(32, -32)
    axes[0].set_ylabel("mm down", fontsize=8)
    figure.tight_layout()
    figure.savefig(out, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--simulated", type=Path, required=True, help="a data set of punnet data simulate")
    parser.add_argument("--real", type=Path, required=True, help=f"folder of {REAL_FILE}")
    parser.add_argument("--out", type=Path, required=True, help="the figure")
    arguments = parser.parse_args()
    real = real_sight(arguments.real)
    sights = [simulated_sight(arguments.simulated, real.observe()), real]
    for sight in sights:
        berry = sight.observe()
        layers, step, holes = layers_and_holes(berry)
        print(
            f"{sight.title}: {len(berry.cloud)} points, {layers} layers {1000 * step:.1f} mm apart, holes {holes:.1%}, "
            f"{berry.distance:.3f} m, dropped {berry.dropped}"
        )
        for name in ("ellipsoid", "weight-shape", "weight-forest"):
            estimator = load_weight_estimator(name)
            estimates = estimator.estimate(sight.frame, sight.berries)
            low, high = estimates.intervals[0]
            print(
                f"  {estimator.name}: {estimates.grams[0]:.1f} g, {low:.1f} to {high:.1f}; true {sight.grams:.1f} g"
            )
    draw(sights, arguments.out)


if __name__ == "__main__":
    main()
