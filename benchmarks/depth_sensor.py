"""How near simulated stereo depth is to a real berry's: layers, roughness and holes, side by side.

    python benchmarks/depth_sensor.py --cloud ../shared/data/dyson/pointcloud_031_1.npz

The real cloud is one berry of the Dyson set, D435i, 184…201 mm away, depth in whole millimetres. Against it, the
model's reading of an ellipsoid with the same outline at the same distance.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from punnet.sim.depth_sensor import StereoDepthModel

REAL_FOCAL = 320.0  # the lattice of its x and y, whatever the camera's focal length was
FOCAL = 615.0


def real_picture(path: Path) -> np.ndarray:
    """The cloud as a depth picture in millimetres, 0 where there is no point."""
    x, y, z = np.load(path)["xyz"].astype(np.float64).T
    u, v = np.rint(x / z * REAL_FOCAL).astype(int), np.rint(y / z * REAL_FOCAL).astype(int)
    picture = np.zeros((np.ptp(v) + 1, np.ptp(u) + 1))
    picture[v - v.min(), u - u.min()] = -z
    return picture


def simulated_picture(shape: tuple[int, int], nearest: float, seed: int) -> np.ndarray:
    """The sensor's reading, in millimetres, of an ellipsoid of that outline in pixels; 0 outside of it."""
    height, width = shape
    half_width = width / 2 / FOCAL * (nearest + 0.012)
    half_height = height / 2 / FOCAL * (nearest + 0.012)
    axes = np.array([half_width, half_height, half_width])
    v, u = np.mgrid[:480, :640]
    rays = np.stack(((u - 319.5) / FOCAL, (v - 239.5) / FOCAL, np.ones(u.shape)), axis=-1) / axes
    centre = np.array([0, 0, nearest + half_width]) / axes
    a, b = (rays**2).sum(-1), rays @ centre
    root = b * b - a * (centre @ centre - 1)
    mask = root > 0
    true = np.where(mask, (b - np.sqrt(np.maximum(root, 0))) / a, 0.7).astype(np.float32)
    seen = StereoDepthModel().apply(true, np.zeros((480, 640, 3), np.uint8), np.random.default_rng(seed))
    rows, columns = np.nonzero(mask)
    return 1000 * np.where(mask, seen, 0)[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]


def describe(picture: np.ndarray) -> dict[str, float]:
    # Every fourth row of the real lattice is empty, by its resampling: leave such rows out on both sides.
    picture = picture[(picture > 0).sum(axis=1) > 3]
    v, u = np.nonzero(picture)
    z = picture[v, u]
    # What a smooth surface leaves: away from the outline, a polynomial of degree 4 in the picture.
    filled = cv2.morphologyEx((picture > 0).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    inside = cv2.erode(filled, np.ones((9, 9), np.uint8))[v, u] > 0
    x, y = (u - u.mean()) / np.ptp(u), (v - v.mean()) / np.ptp(v)
    terms = [x**i * y**j for i in range(5) for j in range(5 - i)]
    design = np.stack(terms, axis=1)
    keep = inside & (np.abs(z - np.median(z)) < 12)
    left = z[keep] - design[keep] @ np.linalg.lstsq(design[keep], z[keep], rcond=None)[0]
    hull = np.zeros(picture.shape, np.uint8)
    cv2.fillConvexPoly(hull, cv2.convexHull(np.column_stack((u, v)).astype(np.int32)), 1)
    counts = np.unique(np.rint(z), return_counts=True)[1]
    return {
        "points": len(z),
        "layers": len(counts),
        "layers holding 90%": int(np.searchsorted(np.cumsum(np.sort(counts)[::-1]), 0.9 * len(z)) + 1),
        "relief 5-95% (mm)": float(np.diff(np.percentile(z, (5, 95)))[0]),
        "roughness (mm)": float(left.std()),
        "holes in the hull (%)": 100 * float(1 - (picture > 0).sum() / hull.sum()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cloud", type=Path, required=True)
    cloud = parser.parse_args().cloud
    real = real_picture(cloud)
    nearest = real[real > 0].min() / 1000
    simulated = [describe(simulated_picture(real.shape, nearest, seed)) for seed in range(10)]
    print(f"{'':24}{'real':>10}{'simulated':>12}")
    for name, value in describe(real).items():
        print(f"{name:24}{value:10.2f}{np.mean([row[name] for row in simulated]):12.2f}")
    at_work = [describe(simulated_picture((58, 46), 0.42, seed)) for seed in range(10)]
    print("\nA 34×42 mm berry at 0.42 m, simulated:")
    for name in at_work[0]:
        print(f"{name:24}{'':10}{np.mean([row[name] for row in at_work]):12.2f}")


if __name__ == "__main__":
    main()
