from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from punnet.data.demos import DemonstrationSet, check_demonstrations, read_demos, suspect_targets
from punnet.scene import Target


def swapped(demonstrations: DemonstrationSet, first: str, second: str) -> DemonstrationSet:
    """The same with the boxes of two targets exchanged."""
    boxes = {e.target_id: e.target.box for e in demonstrations if e.target is not None}
    exchanged = {first: boxes[second], second: boxes[first]}
    return DemonstrationSet(
        tuple(
            replace(e, target=Target(box=exchanged[e.target_id])) if e.target_id in exchanged else e
            for e in demonstrations
        )
    )


def far_apart(demonstrations: DemonstrationSet, group: str) -> tuple[str, str]:
    ends = {e.target_id: e.poses.end[1:3] for e in demonstrations if e.group == group and e.poses is not None}
    names = list(ends)
    pairs = [(float(np.linalg.norm(ends[a] - ends[b])), a, b) for a in names for b in names if a < b]
    return max(pairs)[1:]


def test_sound_boxes_are_not_suspected(wall: DemonstrationSet) -> None:
    assert suspect_targets(wall) == []


def test_a_swap_within_a_scene_is_found_and_told(wall: DemonstrationSet) -> None:
    first, second = far_apart(wall, "plant-1")
    suspects = suspect_targets(swapped(wall, first, second))
    assert {(s.target_id, s.swapped_with) for s in suspects} == {(first, second), (second, first)}
    assert all(s.residual > 0.05 and s.distance > 4.3 and s.group == "plant-1" for s in suspects)
    faults = check_demonstrations(swapped(wall, first, second))
    assert [fault.code for fault in faults] == ["suspected-swap"] * 2


def test_a_box_of_nothing_is_a_mismatch_without_partner(wall: DemonstrationSet) -> None:
    corner = np.array([0.0, 0.0, 6.0, 6.0])
    boxed = next(e for e in wall if e.poses is not None and e.poses.end[1] < -0.05)  # on the other side
    moved = DemonstrationSet(
        tuple(replace(e, target=Target(box=corner)) if e.target_id == boxed.target_id else e for e in wall)
    )
    suspects = suspect_targets(moved)
    assert [(s.target_id, s.swapped_with) for s in suspects] == [(boxed.target_id, None)]
    assert check_demonstrations(moved)[0].code == "suspected-mismatch"


def test_a_swap_between_scenes_is_not_called_one(wall: DemonstrationSet) -> None:
    first, second = far_apart(wall, "plant-1")[0], far_apart(wall, "plant-2")[1]
    for suspect in suspect_targets(swapped(wall, first, second)):
        assert suspect.swapped_with is None


def test_nothing_is_said_of_few_targets_or_moving_cameras(wall: DemonstrationSet) -> None:
    first, second = far_apart(wall, "plant-0")
    bad = swapped(wall, first, second)
    few = bad.subset(range(12))
    assert suspect_targets(few) == []
    moved = np.eye(4)
    moved[0, 3] = 0.3
    elsewhere = tuple(
        replace(e, photographs=(replace(e.home, T_base_camera=moved),))
        if e.group == "plant-2" and e.home
        else e
        for e in bad
    )
    assert suspect_targets(DemonstrationSet(elsewhere)) == []
    same_box = DemonstrationSet(tuple(replace(e, target=Target(box=np.array([1.0, 1, 9, 9]))) for e in wall))
    assert suspect_targets(same_box) == []


def test_joints_alone_do_with_kinematics(wall: DemonstrationSet) -> None:
    first, second = far_apart(wall, "plant-1")
    joints_only = DemonstrationSet(tuple(replace(e, poses=None) for e in swapped(wall, first, second)))

    def kinematics(joints: np.ndarray) -> np.ndarray:
        T = np.tile(np.eye(4), (*joints.shape[:-1], 1, 1))
        T[..., 0, 3], T[..., 1, 3], T[..., 2, 3] = 0.55, joints[..., 0], joints[..., 1] + 0.7
        return T

    assert suspect_targets(joints_only) == []
    assert {s.target_id for s in suspect_targets(joints_only, kinematics)} == {first, second}


def test_the_labs_reaches_are_flagged_as_their_index_does(shared_data: Path) -> None:
    index = json.loads((shared_data / "reach" / "index.json").read_text())
    told = {e["id"]: e["likely_swapped_with"] for e in index if e["suspect_pairing"]}
    found = {s.target_id: s.swapped_with for s in suspect_targets(read_demos(shared_data / "reach"))}
    assert found == told
    assert len(found) == 9


@pytest.mark.parametrize("share", [0.0, 0.2])
def test_outliers_do_not_drag_the_fit(wall: DemonstrationSet, share: float) -> None:
    """Every fifth reach ends anywhere; the sound ones stay unsuspected."""
    rng = np.random.default_rng(5)
    wrong = set(list(wall.targets)[:: round(1 / share)] if share else [])
    signs = {name: rng.choice([-1, 1]) for name in wall.targets}
    episodes = []
    for e in wall:
        assert e.poses is not None
        if e.target_id in wrong:
            values = e.poses.values.copy()
            values[:, 1:3] += np.array([0.2, -0.25]) * signs[e.target_id]
            episodes.append(replace(e, poses=replace(e.poses, values=values)))
        else:
            episodes.append(e)
    assert {s.target_id for s in suspect_targets(DemonstrationSet(tuple(episodes)))} == wrong
