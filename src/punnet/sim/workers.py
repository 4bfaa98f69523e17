"""Many plants at a time: on this machine's cores (loky), or on the machines of a Ray cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal, TypeVar

from punnet.errors import ConfigurationError

__all__ = ["BACKENDS", "Backend", "require_backend", "run_jobs"]

Backend = Literal["loky", "ray"]
BACKENDS = ("loky", "ray")

_RAY_BATCH = 16

Result = TypeVar("Result")


def require_backend(what: str, backend: str) -> None:
    """Make sure that there is such a back end, and let joblib know the Ray cluster that this machine is connected to.

    Not connected to one, it is a cluster of one machine. ``what`` is who asks, for the error.

    Raises
    ------
    ConfigurationError
        If there is none of that name, or Ray is not installed.
    """
    if backend not in BACKENDS:
        raise ConfigurationError(f"{what}: backend must be one of {', '.join(BACKENDS)}, got {backend!r}")
    if backend == "loky":
        return
    try:
        from ray.util.joblib import register_ray  # type: ignore[import-not-found]
    except ImportError as error:
        raise ConfigurationError(f"{what}: --backend ray needs Ray: pip install 'punnet[scale]'") from error
    register_ray()


def run_jobs(
    work: Callable[..., Result], jobs: Sequence[tuple[Any, ...]], workers: int, backend: str = "loky"
) -> Iterator[Result]:
    """Results of ``work(*job)`` for each job, in the order in which they are done.

    Workers have one thread each for NumPy and ONNX Runtime. With ``ray``, after :func:`require_backend`.
    """
    import joblib

    tasks = [joblib.delayed(work)(*job) for job in jobs]
    if backend == "ray":
        with joblib.parallel_config(backend="ray", n_jobs=workers):
            # Ray gives results only when all of a call are there: batches, so that there is progress.
            for start in range(0, len(tasks), _RAY_BATCH * workers):
                yield from joblib.Parallel(n_jobs=workers)(tasks[start : start + _RAY_BATCH * workers])
        return
    with joblib.parallel_config(backend="loky", n_jobs=workers, inner_max_num_threads=1):
        yield from joblib.Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1)(tasks)
