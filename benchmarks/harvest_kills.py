"""Kill a harvest at random moments, go on with it, and see whether anything was lost or counted twice.

    python benchmarks/harvest_kills.py --kills 100 --seed 0

A process harvests a small plant; it is killed (SIGKILL) at a random moment, another one goes on, is killed, and so on,
until the harvest is done; then the next plant. After each kill the log must be whole, and hold every attempt that it
held before; the finished harvest must be the one that nobody killed, number for number.
"""

from __future__ import annotations

import argparse
import json
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from punnet.harvest.durable import read_lines
from punnet.harvest.folder import LOG_FILE, HarvestFolder
from punnet.harvest.scenario import Scenario
from punnet.harvest.session_folder import journaled_session
from punnet.outputs import MARKER_FILE
from punnet.sim.cluster import ClusterConfig
from punnet.sim.ripeness import RipenessStage
from punnet.sim.world import WorldConfig

PLANT = ClusterConfig(
    trusses=(2, 2),
    berries=(2, 2),
    stage_shares={RipenessStage.RIPE: 1.0},
    canopy_leaves=(1, 1),
    hanging_leaves=(0, 0),
)
FRESH = "fresh"


def harvest(folder: Path, seed: int, how: str) -> None:
    """Harvest a plant into a folder, anew or on from where a killed process left it; what the worker processes do."""
    with (
        HarvestFolder(folder, force=True, resume=how != FRESH) as output,
        journaled_session(output, Scenario(seed, "oracle", WorldConfig(PLANT, arm_visuals=False)), {}) as (
            session,
            journal,
            _,
        ),
    ):
        run = session.run()
        journal.note(
            "ended", punnets_g=run.punnet_weights, picked=sum(fate.success for fate in session.fates())
        )


def worker(folder: Path, seed: int) -> subprocess.Popen[bytes]:
    """Start a process that harvests; it goes on if there is something to go on with."""
    log = folder / LOG_FILE
    how = "resume" if log.is_file() and log.stat().st_size else FRESH
    return subprocess.Popen([sys.executable, __file__, "--worker", str(folder), str(seed), how])


def ended(folder: Path) -> list[dict[str, Any]]:
    """The attempts that a log counts, less what depends on how fast the computer is."""
    log = folder / LOG_FILE
    records = read_lines(log)[0] if log.is_file() else []
    counted = [record for record in records if record["kind"] == "attempt_ended"]
    varying = ("n", "time", "seconds_computing", "seconds")
    return [{key: record[key] for key in record if key not in varying} for record in counted]


def outcome(folder: Path) -> tuple[list[dict[str, Any]], list[float], int]:
    """The attempts of a finished harvest, what the punnets weigh, and how many berries are in them in truth."""
    last = read_lines(folder / LOG_FILE)[0][-1]
    assert last["kind"] == "ended", f"{folder}: {last}"
    return ended(folder), last["punnets_g"], last["picked"]


def is_finished(folder: Path) -> bool:
    """Whether a folder holds a complete harvest."""
    marker = folder / MARKER_FILE
    return marker.is_file() and json.loads(marker.read_text())["complete"]


def kill_until_done(folder: Path, seed: int, draw: random.Random, longest: float) -> tuple[int, int]:
    """Harvest with kills at random moments until it is done; how often it was killed, and in the middle of an attempt."""
    kills = in_flight = 0
    while not is_finished(folder):
        before = ended(folder)
        process = worker(folder, seed)
        try:
            process.wait(timeout=draw.uniform(0.0, longest))
            assert process.returncode == 0, f"worker of seed {seed} failed"
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.wait()
            kills += 1
            after = ended(folder)
            assert after[: len(before)] == before, "an attempt that had ended is not there any more"
            numbers = [attempt["number"] for attempt in after]
            assert numbers == list(range(1, len(numbers) + 1)), f"attempts {numbers}"
            log = folder / LOG_FILE
            records = read_lines(log)[0] if log.is_file() else []
            in_flight += bool(records) and records[-1]["kind"] == "attempt_begun"
    return kills, in_flight


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=100, help="at least so many")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--longest", type=float, default=0.0, help="seconds to the latest kill; 0: as long as a harvest"
    )
    parser.add_argument("--worker", nargs=3, metavar=("FOLDER", "SEED", "HOW"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.worker:
        folder, seed, how = arguments.worker
        harvest(Path(folder), int(seed), how)
        return
    draw = random.Random(arguments.seed)
    kills = in_flight = harvests = attempts = 0
    with tempfile.TemporaryDirectory() as temporary:
        while kills < arguments.kills:
            seed = 1000 * arguments.seed + harvests
            calm, killed = Path(temporary) / f"calm-{seed}", Path(temporary) / f"killed-{seed}"
            began = time.perf_counter()
            assert worker(calm, seed).wait() == 0
            longest = arguments.longest or time.perf_counter() - began
            more, flying = kill_until_done(killed, seed, draw, longest)
            assert outcome(killed) == outcome(calm), f"seed {seed}: the killed harvest is another one"
            kills, in_flight, harvests = kills + more, in_flight + flying, harvests + 1
            attempts += len(ended(calm))
            print(
                f"plant {seed}: {len(ended(calm))} attempts, killed {more} times, the same harvest",
                flush=True,
            )
    print(
        f"{kills} kills over {harvests} harvests with {attempts} attempts, {in_flight} of them in the middle of an attempt: "
        "nothing lost but the attempt in flight, nothing counted twice, every harvest as without kills"
    )


if __name__ == "__main__":
    main()
