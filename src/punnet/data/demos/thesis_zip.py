"""The thesis' own annotations: ``annotation.zip``, or the folder in it, with ``J1/0.json`` … ``J7/24.json``.

Each file is one joint of one target: ``mean_weights`` (8, 1) and ``L``, the 36 entries of an LDLᵀ factor in the order of
TensorFlow Probability's ``fill_triangular``, D on the diagonal. Basis: 8 functions, h = 0.07, as recorded.
"""

from __future__ import annotations

import io
import json
import math
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.data.demos.episode import Episode
from punnet.data.demos.faults import EpisodeRefused
from punnet.data.demos.reading import Reading, number_array
from punnet.data.demos.trajectory import WeightDistribution
from punnet.errors import FileFormatError, ShapeError

__all__ = ["RECORDED_WIDTH", "covariance_of_factors", "fill_triangular", "is_thesis_zip", "read_thesis_zip"]

RECORDED_WIDTH = 0.07
"""h of the basis that the lab's weights belong to."""

JOINTS, BASIS, SAMPLES = 7, 8, 150
_MEMBER = re.compile(r"(?:^|/)J([1-7])/([^/]+)\.json$")
_MOST_BYTES = 1_000_000


def is_thesis_zip(path: Path) -> bool:
    """Whether there are files ``J1/*.json`` in this zip or folder."""
    try:
        return any(True for _ in _members(path))
    except FileFormatError:
        return False


def read_thesis_zip(path: str | Path) -> Reading:
    """Read the targets, each a distribution of joint trajectories; blocks that are no covariance are kept as they are."""
    path = Path(path)
    reading = Reading(path, info={"basis": {"count": BASIS, "width": RECORDED_WIDTH}})
    targets: dict[str, dict[int, bytes]] = {}
    for joint, target, content in _members(path):
        targets.setdefault(target, {})[joint] = content
    for target in sorted(targets, key=_by_number):
        with reading.episode(target):
            reading.add(_episode(target, targets[target]))
    return reading


def fill_triangular(entries: ArrayLike) -> NDArray[np.float64]:
    """Lower triangular (n, n) of n (n + 1) / 2 entries, as ``tfp.math.fill_triangular`` lays them out.

    Raises
    ------
    ShapeError
        If their number is not triangular.
    """
    vector = np.asarray(entries, dtype=np.float64)
    side = round((math.sqrt(8.0 * vector.size + 1.0) - 1.0) / 2.0)
    if vector.ndim != 1 or side < 1 or side * (side + 1) // 2 != vector.size:
        raise ShapeError(f"fill_triangular: n (n + 1) / 2 entries are needed, got {vector.shape}")
    return np.asarray(np.tril(np.concatenate((vector[side:], vector[::-1])).reshape(side, side)))


def covariance_of_factors(entries: ArrayLike) -> NDArray[np.float64]:
    """``L D Lᵀ`` (n, n) of n (n + 1) / 2 entries: D on the diagonal, unit L below it."""
    factor = fill_triangular(entries)
    diagonal = np.diag(factor)
    L = factor - np.diag(diagonal) + np.eye(len(factor))
    covariance = (L * diagonal) @ L.T
    return np.asarray((covariance + covariance.T) / 2.0)


def _members(path: Path) -> Iterator[tuple[int, str, bytes]]:
    """Joint, target and content of each file."""
    if path.is_dir():
        for file in sorted(path.glob("**/J[1-7]/*.json")):
            found = _MEMBER.search(file.as_posix())
            if found and not file.name.startswith("."):
                yield int(found[1]), found[2], file.read_bytes()
        return
    try:
        with zipfile.ZipFile(path) as archive:
            for entry in archive.infolist():
                found = _MEMBER.search(entry.filename)
                hidden = "__MACOSX" in entry.filename or PurePosixPath(entry.filename).name.startswith(".")
                if found and not hidden and entry.file_size <= _MOST_BYTES:
                    yield int(found[1]), found[2], archive.read(entry)
    except (OSError, zipfile.BadZipFile, zipfile.LargeZipFile, RuntimeError, NotImplementedError) as error:
        raise FileFormatError(f"{path}: not a readable zip ({error})") from error
    except Exception as error:  # a damaged stream inside the zip: zlib.error, EOFError and others
        raise FileFormatError(f"{path}: damaged zip ({type(error).__name__}: {error})") from error


def _episode(target: str, files: dict[int, bytes]) -> Episode:
    if missing := [f"J{joint}" for joint in range(1, JOINTS + 1) if joint not in files]:
        raise EpisodeRefused(
            [
                (
                    "missing-field",
                    f"no {', '.join(missing)}; a target needs one file for each of {JOINTS} joints",
                )
            ]
        )
    means, covariances, findings = [], [], []
    for joint in range(1, JOINTS + 1):
        try:
            mean, covariance = _joint(files[joint], f"J{joint}/{target}.json")
        except EpisodeRefused as error:
            findings += error.findings
            continue
        means.append(mean)
        covariances.append(covariance)
    if findings:
        raise EpisodeRefused(findings)
    try:
        weights = WeightDistribution(np.stack(means), np.stack(covariances), RECORDED_WIDTH)
    except ShapeError as error:  # finite factors whose product is not
        raise EpisodeRefused([("not-finite", str(error))]) from error
    return Episode(
        id=target,
        joints=weights.mean_trajectory(SAMPLES),
        joint_weights=weights,
        extra={"weight_files": [f"J{joint}/{target}.json" for joint in range(1, JOINTS + 1)]},
    )


def _joint(content: bytes, where: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    try:
        data: Any = json.load(io.BytesIO(content))
        mean, factors = data["mean_weights"], data["L"]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise EpisodeRefused(
            [("missing-field", f"{where}: an object with mean_weights and L is needed ({error!r:.80})")]
        ) from error
    weights, entries = number_array(mean, f"{where}: mean_weights"), number_array(factors, f"{where}: L")
    if weights.size != BASIS or entries.shape != (BASIS * (BASIS + 1) // 2,):
        raise EpisodeRefused(
            [
                (
                    "length-mismatch",
                    f"{where}: {BASIS} weights and {BASIS * (BASIS + 1) // 2} factors are needed, "
                    f"got {weights.size} and {entries.shape}",
                )
            ]
        )
    if not (np.isfinite(weights).all() and np.isfinite(entries).all()):
        raise EpisodeRefused([("not-finite", f"{where}: NaN or infinity")])
    with np.errstate(over="ignore", invalid="ignore"):
        return weights.ravel(), covariance_of_factors(entries)


def _by_number(name: str) -> tuple[int, str]:
    return (int(name), name) if name.isdigit() else (2**31, name)
