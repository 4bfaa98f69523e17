from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from punnet.data.demos import read_demos, read_readable_demos, validate_demos
from punnet.data.demos.thesis_zip import covariance_of_factors, fill_triangular
from punnet.errors import FileFormatError, ShapeError
from punnet.robot import Panda


def joint(diagonal: float = 1.0) -> dict[str, Any]:
    """Weights 0 … 0.7; L unit, D constant: the entries of fill_triangular with D on the diagonal."""
    factor = np.full((8, 8), 0.5) * np.tri(8, k=-1) + diagonal * np.eye(8)
    return {"mean_weights": [[0.1 * k] for k in range(8)], "L": entries_of(factor), "configuration": 0}


def entries_of(factor: np.ndarray) -> list[float]:
    """Inverse of fill_triangular: which entry stands where is asked of it itself."""
    order = fill_triangular(np.arange(1, 37)).astype(int)
    entries = np.zeros(36)
    for row, column in zip(*np.tril_indices(8), strict=True):
        entries[order[row, column] - 1] = factor[row, column]
    return entries.tolist()


def write(path: Path, targets: dict[str, list[dict[str, Any]]]) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, joints in targets.items():
            for number, content in enumerate(joints, start=1):
                archive.writestr(f"annotation/J{number}/{name}.json", json.dumps(content))
                archive.writestr(f"__MACOSX/annotation/J{number}/._{name}.json", "junk")
    return path


def test_fill_triangular_is_tensorflow_probabilitys() -> None:
    # the example of its documentation
    np.testing.assert_array_equal(fill_triangular([1, 2, 3, 4, 5, 6]), [[4, 0, 0], [6, 5, 0], [3, 2, 1]])
    with pytest.raises(ShapeError, match=r"n \(n \+ 1\) / 2"):
        fill_triangular([1, 2])


def test_factors_make_a_covariance(rng: np.random.Generator) -> None:
    L, D = np.tril(rng.normal(size=(8, 8)), -1) + np.eye(8), rng.uniform(0.1, 2.0, 8)
    entries = entries_of(np.tril(L, -1) + np.diag(D))
    np.testing.assert_allclose(covariance_of_factors(entries), L @ np.diag(D) @ L.T, atol=1e-12)


def test_reads_targets_in_order_and_passes_over_junk(tmp_path: Path) -> None:
    path = write(tmp_path / "a.zip", {name: [joint()] * 7 for name in ("10", "2", "0")})
    demonstrations = read_demos(path)
    assert [episode.id for episode in demonstrations] == ["0", "2", "10"]
    weights = demonstrations[0].joint_weights
    assert weights is not None
    np.testing.assert_allclose(weights.mean[3], np.arange(8) * 0.1)
    assert weights.is_psd.all()
    assert len(demonstrations[0].movement) == 150
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "folder")
    assert len(read_demos(tmp_path / "folder")) == 3


def test_a_block_that_is_none_is_kept_and_reported(tmp_path: Path) -> None:
    joints = [joint() for _ in range(7)]
    joints[4] = joint(-0.3)
    path = write(tmp_path / "a.zip", {"3": joints})
    report = validate_demos(path)
    assert [(fault.code, fault.episode) for fault in report.faults] == [("not-psd", "3")]
    assert "J5/3.json" in report.faults[0].message


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"L": [1.0] * 35}, "length-mismatch"),
        ({"mean_weights": [1.0]}, "length-mismatch"),
        ({"L": None}, "length-mismatch"),
        ({"L": [float("nan")] * 36}, "not-finite"),
        ({"mean_weights": ["a"] * 8}, "missing-field"),
    ],
)
def test_a_faulty_target_is_left_out(tmp_path: Path, change: dict[str, Any], code: str) -> None:
    joints = [joint() for _ in range(7)]
    joints[2] |= change
    reading = read_readable_demos(write(tmp_path / "a.zip", {"0": [joint()] * 7, "1": joints}))
    assert [episode.id for episode in reading.episodes] == ["0"]
    assert [fault.code for fault in reading.left_out] == [code]
    assert "J3/1.json" in reading.left_out[0].message


def test_missing_joints_and_damaged_zips(tmp_path: Path) -> None:
    reading = read_readable_demos(write(tmp_path / "a.zip", {"0": [joint()] * 5}))
    assert "no J6, J7" in reading.left_out[0].message
    (tmp_path / "b.zip").write_bytes((tmp_path / "a.zip").read_bytes()[:-30])
    with pytest.raises(FileFormatError, match=r"b\.zip"):
        read_demos(tmp_path / "b.zip", "thesis")


def test_the_thesis_own_targets(shared_data: Path) -> None:
    path = shared_data / "thesis_demos" / "annotation.zip"
    demonstrations = read_demos(path)
    assert len(demonstrations) == 25
    report = validate_demos(path)
    assert [(fault.code, fault.episode) for fault in report.faults] == [("not-psd", "4")]
    assert "J5/4.json" in report.faults[0].message
    # the lab's rig: from home to flange positions before the plant
    starts = np.array([episode.movement.values[0] for episode in demonstrations])
    np.testing.assert_allclose(starts, np.tile(Panda().home, (25, 1)), atol=0.05)
    ends = Panda().forward_kinematics(np.array([episode.movement.end for episode in demonstrations]))[
        :, :3, 3
    ]
    assert (ends.min(axis=0) > [0.5, -0.2, 0.6]).all()
    assert (ends.max(axis=0) < [0.62, 0.2, 0.9]).all()
