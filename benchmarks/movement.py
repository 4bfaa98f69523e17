"""Speed and correctness of movement primitives against their peers, in one run.

    python benchmarks/movement.py --peers ../peers/bin/python

Ten demonstrations of 150 samples and seven joints, eight weights a joint, the same basis for all:

* ours: `punnet.movement`, from lists of arrays to a `TrajectoryDistribution`, with all its checks;
* `movement-primitives` (NumPy): `imitate`, `weights` for each demonstration with their mean and covariance,
  `sample_trajectories`, `var_trajectory`, `via_points`;
* `mp-pytorch` (PyTorch): what it has of that: regression for all demonstrations at once, and samples.

--peers is the interpreter of an environment with both (`pip install movement-primitives mp-pytorch torch
matplotlib addict`). Each package has one process; they take turns, job by job, and the median
counts: of the processor time with one thread, of the clock's with more, as the packages come. Then the results are
compared with the closed form.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.movement import (
    ExpectationMaximisation,
    GaussianBasis,
    ProMP,
    Ridge,
    TrajectoryDistribution,
    ViaPoint,
)

Array = NDArray[np.float64]

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
DEMONSTRATIONS, SAMPLES, JOINTS, WEIGHTS = 10, 150, 7, 8
UNSEEN = 200
DRAWN = 1000
NOISE = 0.01
WIDTH = -1.0 / (8.0 * WEIGHTS**2 * np.log(0.7))  # what movement-primitives has
VIA_PHASES = np.linspace(0.0, 1.0, 5)
VIA_STD = 0.3
TURN = 0.05  # seconds that a turn lasts at least
REFERENCE = "movement-primitives"
BARS = {
    "EM fit": 10.0,
    "ridge fit": 100.0,
    "1,000 samples": 10.0,
    "five via-points": 3.0,
}
JOBS = (*BARS, "variance")
TIMER = """
import sys, time
def turn(job, least):
    # Processor time: with one thread it is what the clock would show on a machine with nothing else to do.
    now = time.process_time if int(sys.argv[-1]) == 1 else time.perf_counter
    times = []
    while sum(times) < least:
        begin = now()
        job()
        times.append(now() - begin)
    return sorted(times)[len(times) // 2]
"""
SERVE = """
print("ready", flush=True)
for line in sys.stdin:
    name = line.strip()
    print(turn(jobs[name], least) if name in jobs else "none", flush=True)
"""
MOVEMENT_PRIMITIVES = """
import numpy as np
from movement_primitives.promp import ProMP, via_points
data = np.load(sys.argv[1])
least, Y, z = float(sys.argv[3]), data["demonstrations"], data["phase"]
D, B = Y.shape[2], int(data["weights"])
times = np.tile(z, (len(Y), 1))
def ridge():
    promp = ProMP(D, B)
    found = np.array([promp.weights(z.copy(), y) for y in Y])
    return promp.from_weight_distribution(found.mean(axis=0), np.cov(found, rowvar=False))
def em():
    promp = ProMP(D, B)
    promp.imitate(times.copy(), Y)
    return promp
prior = ProMP(D, B).from_weight_distribution(data["mean"], data["covariance"])
def via():
    return via_points(prior, data_via, values)
data_via, values = data["via_phases"], data["via_values"]
jobs = {
    "ridge fit": ridge,
    "EM fit": em,
    "1,000 samples": lambda: prior.sample_trajectories(z.copy(), int(data["drawn"]), np.random.RandomState(0)),
    "variance": lambda: prior.var_trajectory(z.copy()),
    "five via-points": via,
}
by_ridge, by_em, exact = ridge(), em(), via()
noisy = via_points(prior, data_via, values, data["via_variances"])
np.savez(sys.argv[2], ridge=by_ridge.weight_mean, em_mean=by_em.weight_mean, em_covariance=by_em.weight_cov,
         exact=exact.weight_mean, noisy=noisy.weight_mean, noisy_covariance=noisy.weight_cov)
"""
MP_PYTORCH = """
import numpy as np, torch
from mp_pytorch.mp import MPFactory
torch.set_num_threads(int(sys.argv[-1]))
data = np.load(sys.argv[1])
least = float(sys.argv[3])
Y = torch.as_tensor(data["demonstrations"])
D, B = Y.shape[2], int(data["weights"])
z = torch.as_tensor(data["phase"])
times = z.expand(len(Y), -1)
factor = float((1.0 / (B - 1)) ** 2 / data["width"])
mp = MPFactory.init_mp("promp", dict(num_basis=B, basis_bandwidth_factor=factor, num_basis_outside=0), D, tau=1.0,
                       dtype=torch.float64)
def ridge():
    found = mp.learn_mp_params_from_trajs(times, Y)["params"]
    return found.mean(0), torch.cov(found.T)
mean, root = torch.as_tensor(data["mean"]), torch.linalg.cholesky(torch.as_tensor(data["covariance"]))
jobs = {
    "ridge fit": ridge,
    "1,000 samples": lambda: mp.sample_trajectories(times=z, params=mean, params_L=root, num_smp=int(data["drawn"])),
}
np.savez(sys.argv[2], ridge=ridge()[0].numpy())
"""


class Peer:
    """A package in a process of its own, which does a job when told and says how long it took."""

    def __init__(self, interpreter: Path, program: str, data: Path, threads: int) -> None:
        self.results = data.with_name(f"{abs(hash(program))}.npz")
        command = [
            interpreter,
            "-W",
            "ignore",
            "-c",
            TIMER + program + SERVE,
            data,
            self.results,
            str(TURN),
            str(threads),
        ]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=os.environ
        )
        if self._answer() != "ready":
            raise SystemExit(f"{interpreter}: the peer did not start; are its packages installed?")

    def _answer(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()

    def turn(self, job: str) -> float | None:
        """Processor seconds that the job takes, None if the package has no such thing."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{job}\n")
        self.process.stdin.flush()
        answer = self._answer()
        return None if answer == "none" else float(answer)

    def close(self) -> None:
        """End the process."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


class Ours:
    """Our own package, in the benchmark's process."""

    def __init__(self, data: dict[str, Any], threads: int) -> None:
        basis, shown = GaussianBasis(WEIGHTS, WIDTH), list(data["demonstrations"])
        prior = TrajectoryDistribution(basis, data["mean"].reshape(JOINTS, WEIGHTS), data["covariance"])
        z, via = data["phase"], list(zip(data["via_phases"], data["via_values"], strict=True))
        ridge, em = ProMP(basis), ProMP(basis, ExpectationMaximisation())
        self.jobs: dict[str, Callable[[], Any]] = {
            "ridge fit": lambda: ridge.fit(shown),
            "EM fit": lambda: em.fit(shown),
            "1,000 samples": lambda: prior.sample(np.random.default_rng(0), DRAWN, z),
            "variance": lambda: prior.std(z),
            "five via-points": lambda: prior.condition([ViaPoint(phase, values) for phase, values in via]),
        }
        scope: dict[str, Any] = {}
        exec(TIMER.replace("sys.argv[-1]", str(threads)), scope)
        self._turn = scope["turn"]
        self.results = {
            "ridge": ProMP(basis, Ridge(shrinkage=0.0)).fit(shown).weight_mean,
            "em": em.fit(shown),
            "shrunk": ridge.fit(shown),
            "exact": prior.condition([ViaPoint(phase, values) for phase, values in via]),
            "noisy": prior.condition([ViaPoint(phase, values, std=VIA_STD) for phase, values in via]),
        }

    def turn(self, job: str) -> float:
        """Processor seconds that the job takes."""
        return float(self._turn(self.jobs[job], TURN))


def problem(seed: int) -> dict[str, Any]:
    """Demonstrations, others of the same kind, and a prior to sample and condition."""
    rng = np.random.default_rng(seed)
    size = JOINTS * WEIGHTS
    factor = 0.5 * rng.normal(size=(size, size)) / np.sqrt(size)
    mean, covariance = rng.normal(size=size), factor @ factor.T + 1e-6 * np.eye(size)
    phase = np.linspace(0.0, 1.0, SAMPLES)
    phi = GaussianBasis(WEIGHTS, WIDTH).phi(phase)
    weights = rng.multivariate_normal(mean, covariance, DEMONSTRATIONS + UNSEEN)
    curves = np.einsum("tb,ndb->ntd", phi, weights.reshape(-1, JOINTS, WEIGHTS))
    curves += rng.normal(0.0, NOISE, curves.shape)
    return {
        "demonstrations": curves[:DEMONSTRATIONS],
        "unseen": curves[DEMONSTRATIONS:],
        "phase": phase,
        "weights": WEIGHTS,
        "width": WIDTH,
        "drawn": DRAWN,
        "mean": mean,
        "covariance": covariance,
        "via_phases": VIA_PHASES,
        "via_values": rng.normal(size=(len(VIA_PHASES), JOINTS)),
        "via_variances": np.full((len(VIA_PHASES), JOINTS), VIA_STD**2),
    }


def closed_form(data: dict[str, Any]) -> tuple[Array, Array]:
    """Posterior mean and covariance given the via-points with noise, by Bayes' rule in information form."""
    precision = np.linalg.inv(data["covariance"])
    information = precision @ data["mean"]
    A = np.concatenate(
        [np.kron(np.eye(JOINTS), row) for row in GaussianBasis(WEIGHTS, WIDTH).phi(VIA_PHASES)]
    )
    precision = precision + A.T @ A / VIA_STD**2
    information = information + A.T @ data["via_values"].ravel() / VIA_STD**2
    return np.linalg.solve(precision, information), np.linalg.inv(precision)


def correctness(
    data: dict[str, Any], ours: Ours, theirs: dict[str, Array], torch: dict[str, Array]
) -> dict[str, float]:
    """How far means are from what they should be, in radians along the movement, and how likely the unseen."""
    phi = GaussianBasis(WEIGHTS, WIDTH).phi(data["phase"])
    via = GaussianBasis(WEIGHTS, WIDTH).phi(VIA_PHASES)

    def off(weights: Array, right: Array, rows: Array = phi) -> float:
        return float(
            np.abs(
                (np.reshape(weights, (JOINTS, WEIGHTS)) - np.reshape(right, (JOINTS, WEIGHTS))) @ rows.T
            ).max()
        )

    def missed(weights: Array) -> float:
        return float(np.abs(np.reshape(weights, (JOINTS, WEIGHTS)) @ via.T - data["via_values"].T).max())

    mean, covariance = closed_form(data)
    em = ours.results["em"]
    other = TrajectoryDistribution(
        em.basis,
        theirs["em_mean"].reshape(JOINTS, WEIGHTS),
        (theirs["em_covariance"] + theirs["em_covariance"].T) / 2,
        observation_std=np.full(JOINTS, NOISE),
    )
    return {
        "ridge mean, movement-primitives from ours": off(theirs["ridge"], ours.results["ridge"]),
        "ridge mean, mp-pytorch from ours": off(torch["ridge"], ours.results["ridge"]),
        "exact via-points missed, ours": missed(ours.results["exact"].weight_mean),
        "exact via-points missed, movement-primitives": missed(theirs["exact"]),
        "noisy via-points: mean off the closed form, ours": off(ours.results["noisy"].weight_mean, mean),
        "noisy via-points: mean off the closed form, movement-primitives": off(theirs["noisy"], mean),
        "noisy via-points: covariance off, ours": float(
            np.abs(ours.results["noisy"].weight_covariance - covariance).max()
        ),
        "noisy via-points: covariance off, movement-primitives": float(
            np.abs(theirs["noisy_covariance"] - covariance).max()
        ),
        "EM, log-likelihood of an unseen reach, ours": float(
            np.mean([em.log_likelihood(values) for values in data["unseen"]])
        ),
        "ridge, log-likelihood of an unseen reach, ours": float(
            np.mean([ours.results["shrunk"].log_likelihood(values) for values in data["unseen"]])
        ),
        "EM, log-likelihood of an unseen reach, movement-primitives": float(
            np.mean([other.log_likelihood(values) for values in data["unseen"]])
        ),
    }


def measure(arguments: argparse.Namespace) -> dict[str, Any]:
    data = problem(arguments.seed)
    ours = Ours(data, arguments.threads)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "problem.npz"
        np.savez(path, **data)
        peers = {REFERENCE: Peer(arguments.peers, MOVEMENT_PRIMITIVES, path, arguments.threads)}
        peers["mp-pytorch"] = Peer(arguments.peers, MP_PYTORCH, path, arguments.threads)
        seconds: dict[str, dict[str, list[float]]] = {job: {} for job in JOBS}
        for _ in range(arguments.rounds):
            for job in JOBS:
                for name, who in {"ours": ours, **peers}.items():
                    taken = who.turn(job)
                    if taken is not None:
                        seconds[job].setdefault(name, []).append(taken)
        for peer in peers.values():
            peer.close()
        theirs, torch = (dict(np.load(peer.results)) for peer in peers.values())
    milliseconds = {
        job: {name: 1e3 * float(np.median(times)) for name, times in each.items()}
        for job, each in seconds.items()
    }
    return {
        "machine": f"{os.cpu_count()} cores, {platform.machine()}, threads each: {arguments.threads}",
        "size": [DEMONSTRATIONS, SAMPLES, JOINTS, WEIGHTS],
        "rounds": arguments.rounds,
        "milliseconds": milliseconds,
        "times_as_fast": {
            job: {name: value / each["ours"] for name, value in each.items() if name != "ours"}
            for job, each in milliseconds.items()
        },
        "correctness": correctness(data, ours, theirs, torch),
    }


def report(figures: dict[str, Any]) -> None:
    print(f"{' × '.join(map(str, figures['size'][:3]))}, {WEIGHTS} weights; {figures['machine']}")
    for job, each in figures["milliseconds"].items():
        row = "   ".join(f"{name} {value:9.3f} ms" for name, value in each.items())
        print(f"  {job:16} {row}")
    for job, bar in BARS.items():
        factor = figures["times_as_fast"][job][REFERENCE]
        verdict = "reached" if factor >= bar else "missed"
        print(f"  {job:16} {factor:8.1f} × as fast as {REFERENCE}; bar {bar:g}: {verdict}")
    print("correctness")
    for what, value in figures["correctness"].items():
        print(f"  {what:64} {value:12.3g}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--peers", type=Path, required=True, help="python with movement-primitives and mp-pytorch"
    )
    parser.add_argument("--rounds", type=int, default=9, help="turns that each takes [%(default)s]")
    parser.add_argument(
        "--threads", type=int, default=1, help="of each; with more than one the clock counts [%(default)s]"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the demonstrations [%(default)s]")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of the table")
    arguments = parser.parse_args()
    threads = str(arguments.threads)
    if any(os.environ.get(variable) != threads for variable in THREADS):
        # NumPy reads these when it is loaded: begin again with the right number.
        os.environ.update(dict.fromkeys(THREADS, threads))
        os.execv(sys.executable, [sys.executable, *sys.argv])
    begin = time.perf_counter()
    figures = measure(arguments)
    if arguments.json:
        print(json.dumps(figures, indent=2))
    else:
        report(figures)
        print(f"{time.perf_counter() - begin:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
