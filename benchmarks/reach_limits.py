"""What the pictures of the real reaches can not tell: `full`'s regression fitted and judged on the same 75.

    python benchmarks/reach_limits.py ../shared/data/reach

Seen: fitted to all scenes and measured on them. With scenes: also told which scene each target is of, so that what differs
between scenes is known. Scenes left out: how much higher their reaches end than the others tell. Repeats: how far single
reaches to one target end from their mean, by the source's covariances. Targets that the source suspects are left out.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos import read_demos
from punnet.planning.reaches import Reaches, reaches_from
from punnet.train.planner.regression import fit_robustly

Array = NDArray[np.float64]
PENALTY, FREEDOM = 1e-3, 2.5


def features(reaches: Reaches) -> Array:
    """(M, 6) polynomial of the box's centre, and the light."""
    u, v = (reaches.centres - 0.5).T
    return np.stack((u, v, u * u, u * v, v * v, reaches.lights), axis=1)


def told(name: str, columns: Array, ends: Array) -> None:
    """Fit and measure on the same rows."""
    off = ends - fit_robustly(columns, ends, np.full(7, PENALTY), FREEDOM)(columns)
    lengths = np.linalg.norm((ends - off)[:, 3:], axis=1, keepdims=True)
    apart = np.linalg.norm((ends - off)[:, 3:] / lengths - ends[:, 3:], axis=1)
    print(
        f"{name}: {1e3 * np.linalg.norm(off[:, :3], axis=1).mean():.1f} mm, y and z "
        f"{1e3 * np.linalg.norm(off[:, 1:3], axis=1).mean():.1f} mm, orientation {apart.mean():.3f}"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("reach", help="folder of the 75 reaches")
    reaches = reaches_from(read_demos(parser.parse_args().reach))
    reaches = reaches.subset(np.flatnonzero(~reaches.suspects))
    last = reaches.basis.phi([1.0])[0]
    ends = reaches.pose.mean @ last
    ends[:, 3:] /= np.linalg.norm(ends[:, 3:], axis=1, keepdims=True)
    seen = features(reaches)
    names = sorted(set(reaches.groups))
    scenes = np.array([[float(group == name) for name in names[1:]] for group in reaches.groups])
    told("seen", seen, ends)
    told("with scenes", np.column_stack((seen, scenes)), ends)
    groups = np.array(reaches.groups)
    for name in names:
        out = groups == name
        off = ends[out] - fit_robustly(seen[~out], ends[~out], np.full(7, PENALTY), FREEDOM)(seen[out])
        print(f"{name} left out: ends {1e3 * off[:, 2].mean():+.1f} mm higher than told")
    H = np.kron(np.eye(7), last[None])
    repeats = np.sqrt(np.einsum("kk->k", H @ reaches.pose.covariance.mean(axis=0) @ H.T)[:3])
    print(
        "repeats, std: "
        + ", ".join(f"{axis} {1e3 * s:.1f} mm" for axis, s in zip("xyz", repeats, strict=True))
    )


if __name__ == "__main__":
    main()
