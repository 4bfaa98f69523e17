"""Speed of weighing: a frame of twelve berries, against Open3D and scikit-learn, in one run on one core.

    python benchmarks/weight.py --open3d ../open3d/bin/python [--estimator weight-forest weight-shape] [--rounds 15]

Twelve berries in a 640×480 frame 0.4 m away, drawn with the depth camera's errors. Masks are given; grams come out:

* ours: each estimator that is named, `Frame` and `Strawberries` in, grams and intervals out;
* the peer: what the thesis did it with. Open3D makes the cloud of each mask, removes statistical outliers and reconstructs
  the convex hull; scikit-learn takes its principal components and predicts by a random forest of 100 trees. The feature
  vector is the thesis', the forest is grown on random numbers: what it says does not count here. The interpreter given
  by --open3d runs it; make it an environment of its own (`pip install open3d scikit-learn`; needs libusb-1.0-0).

Both run on one core and take turns; processor time counts, so that a busy machine does not, and of it the median. Stages of
ours are timed apart.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from punnet.geometry import CameraIntrinsics, back_project, project
from punnet.scene import Frame, Strawberries
from punnet.sim.depth_sensor import StereoDepthModel
from punnet.weight import LearnedWeightEstimator, WeightEstimator, observe
from punnet.weight.choosing import load_weight_estimator
from punnet.weight.features import feature_matrix

CAMERA = CameraIntrinsics(640, 480, 615.0, 615.0, 319.5, 239.5)
ROWS, COLUMNS, DISTANCE = 3, 4, 0.40
LIMIT_MILLISECONDS = 5.0
PEER = """
import json, sys, time
import numpy as np
import open3d as o3d
from sklearn.decomposition import PCA
from sklearn.ensemble import RandomForestRegressor

data = np.load(sys.argv[1])
rgb, depth, masks = data["rgb"], data["depth"], data["masks"]
fx, fy, cx, cy = data["camera"]
camera = o3d.camera.PinholeCameraIntrinsic(depth.shape[1], depth.shape[0], fx, fy, cx, cy)
rng = np.random.default_rng(0)
forest = RandomForestRegressor(n_estimators=100, n_jobs=1, random_state=0)
forest.fit(rng.random((1900, 26)), rng.normal(18.6, 5.7, 1900))

def features(mask):
    rows, columns = np.nonzero(mask)
    box = (rows.max() - rows.min() + 1) * (columns.max() - columns.min() + 1)
    image = o3d.geometry.Image(np.where(mask, depth, 0).astype(np.float32))
    cloud = o3d.geometry.PointCloud.create_from_depth_image(image, camera, depth_scale=1.0, depth_trunc=3.0)
    cloud, _ = cloud.remove_statistical_outlier(nb_neighbors=20, std_ratio=2.0)
    hull, _ = cloud.compute_convex_hull()
    hull.compute_vertex_normals()
    found = PCA(n_components=3).fit(np.asarray(hull.vertices))
    histogram, _ = np.histogram(np.asarray(cloud.points)[:, 2], bins=12)
    return [box, mask.sum(), *histogram, *found.components_.ravel(), *found.explained_variance_]

def frame():
    return forest.predict(np.array([features(mask) for mask in masks]))

print("ready", flush=True)
for line in sys.stdin:
    begin = time.process_time()
    frame()
    print(time.process_time() - begin, flush=True)
"""


def berry_frame(seed: int) -> tuple[Frame, Strawberries]:
    """Twelve ellipsoids of 11 to 30 g before a wall, each turned another way, as a depth camera sees them."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    rays = back_project(CAMERA, np.stack((u, v), axis=-1), np.ones(u.shape))
    depth = np.full(u.shape, DISTANCE + 0.3, dtype=np.float32)
    masks = np.zeros((ROWS * COLUMNS, *u.shape), dtype=np.bool_)
    keypoints = np.full((len(masks), 5, 2), np.nan)
    for index, mask in enumerate(masks):
        place = np.array((index % COLUMNS - (COLUMNS - 1) / 2, index // COLUMNS - (ROWS - 1) / 2)) * (
            0.085,
            0.08,
        )
        centre = np.array((*place, DISTANCE + rng.uniform(-0.03, 0.03)))
        half = np.array((1.0, 1.25, 1.0)) * rng.uniform(0.0125, 0.0165)
        roll = rng.uniform(-0.4, 0.4)
        R = np.array([[math.cos(roll), -math.sin(roll), 0], [math.sin(roll), math.cos(roll), 0], [0, 0, 1]])
        scaled, origin = rays @ R / half, centre @ R / half
        a, b = (scaled**2).sum(axis=-1), scaled @ origin
        discriminant = b * b - a * (origin @ origin - 1.0)
        hit = np.asarray(discriminant > 0)
        mask[:] = hit
        depth[hit] = ((b - np.sqrt(np.maximum(discriminant, 0.0))) / a)[hit]
        ends = np.array(
            [(0, -half[1] - 0.02, 0), (0, -half[1], 0), (0, half[1], 0), (-half[0], 0, 0), (half[0], 0, 0)]
        )
        keypoints[index] = project(CAMERA, centre + ends @ R.T)
    rgb = np.where(masks.any(axis=0)[..., None], (180, 30, 30), (60, 120, 60)).astype(np.uint8)
    seen = StereoDepthModel().apply(depth, rgb, rng)
    boxes = [(*np.argwhere(m).min(axis=0)[::-1], *np.argwhere(m).max(axis=0)[::-1]) for m in masks]
    berries = Strawberries(
        u.shape,
        np.array(boxes, dtype=np.float64),
        masks=masks,
        keypoints=keypoints,
        visibility=np.full((len(masks), 5), 2),
        ripeness=np.ones(len(masks)),
    )
    return Frame(rgb, seen, CAMERA), berries


class Peer:
    """Open3D and scikit-learn in an interpreter of their own; weighs the frame each time it is asked."""

    def __init__(self, interpreter: Path, frame: Frame, berries: Strawberries, folder: Path) -> None:
        path = folder / "frame.npz"
        assert frame.depth is not None
        assert berries.masks is not None
        camera = [CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy]
        np.savez(path, rgb=frame.rgb, depth=frame.depth, masks=berries.masks, camera=camera)
        self._process = subprocess.Popen(
            [interpreter, "-c", PEER, path],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
        )
        self._answer("ready")

    def _answer(self, wanted: str | None = None) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline().strip()
        if not line or (wanted is not None and line != wanted):
            raise SystemExit(
                f"the peer could not be started ({line or 'it ended'}); see --help for what it needs"
            )
        return line

    def seconds(self) -> float:
        """Processor time that weighing the frame once took."""
        assert self._process.stdin is not None
        self._process.stdin.write("again\n")
        self._process.stdin.flush()
        return float(self._answer())

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def seconds_of(estimator: WeightEstimator, frame: Frame, berries: Strawberries) -> float:
    begin = time.process_time()
    estimator.estimate(frame, berries)
    return time.process_time() - begin


def stages(estimator: WeightEstimator, frame: Frame, berries: Strawberries, rounds: int) -> dict[str, float]:
    """Median milliseconds a berry of observing and of the features."""
    times: dict[str, list[float]] = {"observe": [], "features": []}
    for _ in range(rounds):
        begin = time.process_time()
        seen = [berry for berry in observe(frame, berries) if not isinstance(berry, str)]
        middle = time.process_time()
        if isinstance(estimator, LearnedWeightEstimator):
            feature_matrix(seen, estimator.settings.feature_groups)
            times["features"].append((time.process_time() - middle) / len(berries))
        times["observe"].append((middle - begin) / len(berries))
    return {name: 1000 * float(np.median(values)) for name, values in times.items() if values}


def measure(arguments: argparse.Namespace, folder: Path) -> dict[str, object]:
    frame, berries = berry_frame(arguments.seed)
    estimators = [load_weight_estimator(name) for name in arguments.estimator]
    for estimator in estimators:
        missing = [reason for reason in estimator.estimate(frame, berries).reasons if reason]
        if missing:
            raise SystemExit(f"{estimator.name}: {missing[0]}")
    peer = None if arguments.open3d is None else Peer(arguments.open3d, frame, berries, folder)
    times: dict[str, list[float]] = {}
    for _ in range(arguments.rounds):
        for estimator in estimators:
            times.setdefault(estimator.name, []).append(seconds_of(estimator, frame, berries))
        if peer is not None:
            times.setdefault("Open3D + scikit-learn", []).append(peer.seconds())
    if peer is not None:
        peer.close()
    milliseconds = {name: 1000 * float(np.median(values)) for name, values in times.items()}
    first = milliseconds[estimators[0].name]
    return {
        "berries": len(berries),
        "milliseconds_a_frame": {name: round(value, 2) for name, value in milliseconds.items()},
        "milliseconds_a_berry": {
            name: round(value / len(berries), 3) for name, value in milliseconds.items()
        },
        "times_as_long": {name: round(value / first, 2) for name, value in milliseconds.items()},
        "stages_milliseconds_a_berry": {
            estimator.name: {
                name: round(value, 3)
                for name, value in stages(estimator, frame, berries, arguments.rounds).items()
            }
            for estimator in estimators
        },
    }


def report(figures: dict[str, object]) -> None:
    a_frame, a_berry, ratios = (
        figures[name] for name in ("milliseconds_a_frame", "milliseconds_a_berry", "times_as_long")
    )
    assert isinstance(a_frame, dict)
    assert isinstance(a_berry, dict)
    assert isinstance(ratios, dict)
    print(f"{figures['berries']} berries, 640×480, one core, median processor time:")
    for name, value in a_frame.items():
        within = "" if name.startswith("Open3D") else f"; limit {LIMIT_MILLISECONDS} ms a berry"
        print(
            f"  {name:24} {value:8.1f} ms a frame {a_berry[name]:7.2f} ms a berry {ratios[name]:7.1f} ×{within}"
        )
    stages_of = figures["stages_milliseconds_a_berry"]
    assert isinstance(stages_of, dict)
    for name, parts in stages_of.items():
        print(f"  {name}: " + ", ".join(f"{part} {value:.2f} ms a berry" for part, value in parts.items()))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--open3d", type=Path, help="interpreter that has open3d and scikit-learn")
    parser.add_argument(
        "--estimator",
        nargs="+",
        default=["weight-forest", "weight-shape", "ellipsoid"],
        help="names or folders",
    )
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        figures = measure(arguments, Path(folder))
    print(json.dumps(figures, indent=1)) if arguments.json else report(figures)


if __name__ == "__main__":
    main()
