"""Our picking orders beside those that people gave to real pictures.

    python benchmarks/picking_order.py DATA/picking_order --split test

The data (982 pictures by Dyson's farms, annotated for github chiarabigi/strawberry_picking_order_prediction) has boxes,
ripeness and, for the ripe berries, the order in which people would pick them; pictures and depth are not in it. So that
our orders can be asked, a berry is placed in space by its box: 30 mm wide, before a camera of 69° like a D435i's. Prints the
mean of Kendall's tau over the pictures (1: the same order, 0: no relation), with a 95% bootstrap interval.
"""

from __future__ import annotations

import argparse
import gzip
import json
import os
import platform
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import kendalltau

from punnet.geometry import CameraIntrinsics
from punnet.harvest.order import ORDERS
from punnet.scene import Frame, Strawberries

CAMERA = CameraIntrinsics(1280, 720, 930.0, 930.0, 639.5, 359.5)
BERRY_WIDTH = 0.030
PLANT = np.array([0.75, -0.06, 0.70])  # where the middle of the berries is put: before the arm
CAMERA_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
NO_PICTURE = np.zeros((720, 1280, 3), np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path, help="folder with train.json.gz, val.json.gz, test.json.gz")
    parser.add_argument("--split", choices=("train", "val", "test", "all"), default="test")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    splits = ("train", "val", "test") if options.split == "all" else (options.split,)
    pictures = [picture for split in splits for picture in read(options.data / f"{split}.json.gz")]
    pictures = [picture for picture in pictures if sum(picture["ripeness"]) >= 2]
    rows = table(pictures)
    if options.json:
        print(json.dumps({"split": options.split, "pictures": len(pictures), "rows": rows}, indent=2))
        return
    print(
        f"{len(pictures)} pictures of {options.split} with two ripe berries or more; {platform.platform()}, "
        f"{os.cpu_count()} cores"
    )
    print(f"{'order':42s} {'tau':>6s}   95%")
    for name, (mean, low, high) in rows.items():
        print(f"{name:42s} {mean:6.3f}   {low:.3f} … {high:.3f}")


def read(path: Path) -> list[dict[str, Any]]:
    with gzip.open(path, "rt") as stream:
        return list(json.load(stream))


def table(pictures: list[dict[str, Any]]) -> dict[str, tuple[float, float, float]]:
    """Mean of tau and its interval, for each of our orders and for three more."""
    taus: dict[str, list[float]] = {name: [] for name in ORDERS}
    others = {
        "right-to-left": lambda p: -np.array(p["boxes"])[:, 0],
        "lowest-first": lambda p: -np.array(p["boxes"])[:, 1],
        "least hidden first (their annotation)": lambda p: np.array(p["occ_ann"], float),
        "the data's own heuristic": lambda p: np.array(p["heuristic_sc_ann"], float),
    }
    taus.update({name: [] for name in others})
    for picture in pictures:
        ripe = np.flatnonzero(np.array(picture["ripeness"]) == 1)
        human = np.array(picture["students_sc_ann"], dtype=np.float64)[ripe]
        frame, berries = placed(picture)
        for name, order in ORDERS.items():
            rank = np.empty(len(berries))
            rows = order(frame, berries)
            rank[rows] = np.arange(len(rows))
            taus[name].append(tau(rank[ripe], human))
        for name, value in others.items():
            taus[name].append(tau(value(picture)[ripe], human))
    return {name: interval(np.array(values)) for name, values in taus.items()}


def placed(picture: dict[str, Any]) -> tuple[Frame, Strawberries]:
    """The picture's berries in space, and a frame without a picture whose camera stands where they are seen from."""
    xywh = np.array(picture["boxes"], dtype=np.float64)
    boxes = np.column_stack((xywh[:, :2], xywh[:, :2] + xywh[:, 2:]))
    depth = CAMERA.fx * BERRY_WIDTH / np.maximum(xywh[:, 2], 0.8 * xywh[:, 3])
    stem = np.column_stack((xywh[:, 0] + xywh[:, 2] / 2.0, xywh[:, 1]))
    local = np.column_stack(
        ((stem[:, 0] - CAMERA.cx) / CAMERA.fx, (stem[:, 1] - CAMERA.cy) / CAMERA.fy, np.ones(len(xywh)))
    )
    points = (local * depth[:, None]) @ CAMERA_AXES.T
    shift = PLANT - np.median(points, axis=0)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = CAMERA_AXES, shift
    classes = np.where(np.array(picture["ripeness"]) == 1, 0, 1)
    return (
        Frame(NO_PICTURE, camera=CAMERA, T_base_camera=T),
        Strawberries((720, 1280), boxes, classes=classes, picking_points=points + shift),
    )


def tau(ours: NDArray[np.float64], human: NDArray[np.float64]) -> float:
    """Kendall's tau; 0 where ours says the same of all."""
    found = kendalltau(ours, human).statistic
    return float(found) if np.isfinite(found) else 0.0


def interval(values: NDArray[np.float64]) -> tuple[float, float, float]:
    """Mean and 95% bootstrap interval."""
    rng = np.random.default_rng(0)
    means = values[rng.integers(0, len(values), (2000, len(values)))].mean(axis=1)
    low, high = np.percentile(means, (2.5, 97.5))
    return round(float(values.mean()), 4), round(float(low), 4), round(float(high), 4)


if __name__ == "__main__":
    main()
