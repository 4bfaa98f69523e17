"""Where the constants of the ellipsoid estimator come from, and how well it weighs simulated berries.

    python benchmarks/weight_constants.py [--berries 300] [--clusters 40] [--first-seed 100]

1. From meshes alone: volume against hull outline and extent, over random views of an upright berry.
2. From simulated first views: the extent along the line of sight, and the bulge that the depth camera shows.
3. Judgement on those views, true masks, with the depth camera's errors: PCW, coverage of the 90% interval, bias.
4. The distribution of estimated weights of ripe berries beside the measured 18.6 ± 5.7 g (4.8…38.9 g).
"""

from __future__ import annotations

import argparse
import math

import numpy as np
from scipy.spatial import ConvexHull

from punnet.sim.berry import Berry, make_berry
from punnet.sim.depth_sensor import StereoDepthModel
from punnet.sim.ripeness import RipenessStage
from punnet.sim.simulated_robot import SimulatedRobot
from punnet.sim.truth import true_strawberries
from punnet.sim.world import build_world
from punnet.weight import (
    BerryObservation,
    EllipsoidConfig,
    EllipsoidEstimator,
    observe,
    percent_correct_weight,
    weight_errors,
)


def from_meshes(berries: int, rng: np.random.Generator) -> tuple[list[float], list[float], list[float]]:
    """Shape factors V / (⅔ A T), thicknesses T / √(length · width) and length / width, two views a berry."""
    factors, thicknesses, elongations = [], [], []
    for _ in range(berries):
        berry = make_berry(rng, RipenessStage.RIPE)
        for _ in range(2):
            turn, tilt = rng.uniform(0, 2 * math.pi), math.radians(rng.normal(12, 8))
            c, s, ct, st = math.cos(turn), math.sin(turn), math.cos(tilt), math.sin(tilt)
            R = np.array([[1, 0, 0], [0, ct, -st], [0, st, ct]]) @ np.array(
                [[c, -s, 0], [s, c, 0], [0, 0, 1]]
            )
            seen = berry.mesh.vertices @ R.T
            area = ConvexHull(seen[:, [0, 2]]).volume
            length, extent = float(np.ptp(seen[:, 2])), float(np.ptp(seen[:, 1]))
            factors.append(berry.volume / (2 / 3 * area * extent))
            thicknesses.append(extent / math.sqrt(4 * area / math.pi))
            elongations.append(length * length / (4 * area / math.pi))
    return factors, thicknesses, elongations


def judge(seeds: range) -> dict[str, np.ndarray]:
    """One row a berry in the clusters' first views."""
    columns = ("true", "grams", "low", "high", "hidden", "gain", "elongation", "ratio", "ripe")
    estimator = EllipsoidEstimator()
    rows = []
    for seed in seeds:
        world = build_world(seed)
        robot = SimulatedRobot(world, np.random.default_rng(seed), StereoDepthModel())
        frame = robot.look()
        truth = true_strawberries(world, frame, robot.segment())
        robot.close()
        estimates = estimator.estimate(frame, truth)
        for i, (identity, seen) in enumerate(zip(truth.ids, observe(frame, truth), strict=True)):
            berry: Berry = world.cluster.berries[identity].berry
            hidden, gain, elongation, ratio = 1.0, math.nan, math.nan, math.nan
            if isinstance(seen, BerryObservation):
                hidden = seen.hidden
                if hidden <= 0.1 and len(seen.cloud) > 200:
                    outline, area = seen.outline, seen.outline.area * seen.scale**2
                    thickness = berry.volume / (2 / 3 * EllipsoidConfig.shape_factor * area)
                    gain = 2 * seen.relief / thickness
                    elongation = outline.length / outline.width
                    ratio = thickness / (math.sqrt(outline.length * outline.width) * seen.scale)
            ripe = float(berry.stage >= RipenessStage.RIPE)
            low, high = estimates.intervals[i]
            rows.append((berry.mass, estimates.grams[i], low, high, hidden, gain, elongation, ratio, ripe))
    return dict(zip(columns, np.array(rows).T, strict=True))


def report_thickness(name: str, elongations: np.ndarray, thicknesses: np.ndarray) -> None:
    exponent, factor = np.polyfit(np.log(elongations), np.log(thicknesses), 1)
    left = np.log(thicknesses) - factor - exponent * np.log(elongations)
    print(
        f"thickness_factor  {math.exp(factor):.3f}  exponent {exponent:.2f}  spread {np.std(left):.3f} ({name})"
    )


def report(name: str, rows: dict[str, np.ndarray], chosen: np.ndarray) -> None:
    true, grams = rows["true"][chosen], rows["grams"][chosen]
    if not len(true):
        return
    errors = weight_errors(true, grams)
    inside = (rows["low"][chosen] <= true) & (true <= rows["high"][chosen])
    scores = " ".join(f"{100 * t:.0f}%:{s:.0f}" for t, s in percent_correct_weight(true, grams).items())
    covered = inside[~np.isnan(grams)].mean()
    print(
        f"{name:28} n {len(true):4} missing {errors.missing:2}  MAPE {errors.mean_percentage:5.1f}%  "
        f"RMSE {errors.root_mean_square:4.2f} g  bias {errors.bias:+.2f} g  coverage {covered:.2f}  PCW {scores}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--berries", type=int, default=300)
    parser.add_argument("--clusters", type=int, default=40)
    parser.add_argument("--first-seed", type=int, default=100)
    arguments = parser.parse_args()
    factors, thicknesses, elongations = from_meshes(arguments.berries, np.random.default_rng(0))
    print(f"shape_factor      {np.median(factors):.3f}  spread {np.std(np.log(factors)):.3f}")
    report_thickness("meshes", np.array(elongations), np.array(thicknesses))
    rows = judge(range(arguments.first_seed, arguments.first_seed + arguments.clusters))
    clear = ~np.isnan(rows["gain"])
    report_thickness("first views", rows["elongation"][clear], rows["ratio"][clear])
    gains = rows["gain"][clear]
    print(f"relief_gain       {np.median(gains):.3f}  spread {np.std(np.log(np.maximum(gains, 0.1))):.3f}")
    free = rows["hidden"] <= EllipsoidConfig.calyx_share
    report("all", rows, np.full(len(free), True))
    report("outline free", rows, free)
    report("outline partly hidden", rows, ~free)
    report("ripe, outline free", rows, free & (rows["ripe"] > 0))
    ripe = rows["grams"][(rows["ripe"] > 0) & ~np.isnan(rows["grams"])]
    truth = rows["true"][rows["ripe"] > 0]
    for name, grams in (("estimated", ripe), ("true", truth)):
        print(
            f"ripe, {name:10} {grams.mean():5.1f} ± {grams.std():.1f} g ({grams.min():.1f}…{grams.max():.1f})"
        )
    print("measured         18.6 ± 5.7 g (4.8…38.9)")


if __name__ == "__main__":
    main()
