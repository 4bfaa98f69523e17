"""Harvest plant after plant in one process, and see whether memory, handles or the time of a pick grow.

    python benchmarks/harvest_soak.py --picks 2000 --seed 0 --csv soak.csv

The process grows a plant, harvests it with the simulated camera and the default perception, frees it, and so on until so
many berries are picked or the time is up. After each plant it notes its resident memory, open files, threads, and
the processor seconds of an attempt. Reported: each at the end against after the warm-up, and the slope over the rest.
"""

from __future__ import annotations

import argparse
import csv
import gc
import json
import threading
import time
from pathlib import Path

import numpy as np

from punnet.harvest.scenario import Scenario, Session
from punnet.perception.choosing import SIMULATION_DETECTOR
from punnet.sim.world import WorldConfig

WARM_UP = 0.1
"""Share of the plants, at least five, after which caches are filled and growth counts."""


def resident_megabytes() -> float:
    """Memory of this process that is in RAM."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def open_files() -> int:
    """Handles of this process."""
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


def harvest(seed: int, perception: str) -> dict[str, float]:
    """Harvest one plant; what there was to note afterwards."""
    began = time.process_time()
    with Session(Scenario(seed, perception, WorldConfig(arm_visuals=False))) as session:
        built = time.process_time()
        run = session.run()
        took = time.process_time() - built
    del session
    gc.collect()
    return {
        "seed": seed,
        "picks": len(run.picked),
        "attempts": len(run.attempts),
        "cpu_seconds": took,
        "build_seconds": built - began,
        "simulated_seconds": run.seconds_simulated,
        "megabytes": resident_megabytes(),
        "files": open_files(),
        "threads": threading.active_count(),
    }


def figures(rows: list[dict[str, float]]) -> dict[str, float]:
    """What has grown between the warm-up and the end, by means over a tenth of the plants, and by a straight line."""
    first = max(5, round(WARM_UP * len(rows)))
    rest = rows[first:] or rows[-1:]
    tenth = max(1, len(rest) // 10)
    picks = np.cumsum([row["picks"] for row in rest])

    def change(values: list[float]) -> float:
        return float(np.mean(values[-tenth:]) / np.mean(values[:tenth]) - 1.0)

    memory = [row["megabytes"] for row in rest]
    pace = [row["cpu_seconds"] / row["simulated_seconds"] for row in rest]
    slope = float(np.polyfit(picks, memory, 1)[0]) if len(rest) > 1 else 0.0
    return {
        "plants": len(rows),
        "picks": sum(row["picks"] for row in rows),
        "attempts": sum(row["attempts"] for row in rows),
        "warm_up_plants": first,
        "megabytes_after_warm_up": round(float(np.mean(memory[:tenth])), 1),
        "megabytes_at_the_end": round(float(np.mean(memory[-tenth:])), 1),
        "megabytes_change": round(change(memory), 4),
        "megabytes_a_thousand_picks": round(1000.0 * slope, 1),
        "files_change": rest[-1]["files"] - rest[0]["files"],
        "threads_change": rest[-1]["threads"] - rest[0]["threads"],
        "cpu_seconds_a_pick": round(
            sum(r["cpu_seconds"] for r in rest) / max(1, sum(r["picks"] for r in rest)), 3
        ),
        "pace_change": round(change(pace), 4),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picks", type=int, default=2000)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="stop after so long")
    parser.add_argument("--seed", type=int, default=0, help="of the first plant; they go on from there")
    parser.add_argument("--perception", default=SIMULATION_DETECTOR, help="a detector, or oracle")
    parser.add_argument("--csv", type=Path, help="one row a plant")
    arguments = parser.parse_args()
    rows: list[dict[str, float]] = []
    end = time.monotonic() + 60.0 * arguments.minutes
    while sum(row["picks"] for row in rows) < arguments.picks and time.monotonic() < end:
        rows.append(harvest(arguments.seed + len(rows), arguments.perception))
        if arguments.csv:
            with arguments.csv.open("w", newline="") as stream:
                writer = csv.DictWriter(stream, fieldnames=list(rows[0]))
                writer.writeheader()
                writer.writerows(rows)
    print(json.dumps(figures(rows), indent=2))


if __name__ == "__main__":
    main()
