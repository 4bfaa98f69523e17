from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from punnet.data.demos import mark_target, read_demos, validate_demos
from punnet.errors import ConfigurationError, FileFormatError, OutputExistsError
from punnet.outputs import Interrupted
from punnet.robot import HOME, PANDA_LIMITS, Panda
from punnet.sim.demonstrations_factory import simulate_demonstration_set
from punnet.sim.demonstrations_scene import grow_scene, photograph_scene
from punnet.sim.truth import true_picking_points
from punnet.sim.world import WorldConfig, build_world

ARM = Panda()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two berries on two plants, two reaches each."""
    place = tmp_path_factory.mktemp("simulated") / "single"
    report = simulate_demonstration_set(place, configurations=2, repeats=2, seed=4, samples=60)
    assert (report.episodes, report.targets, report.plants, report.made, report.kept) == (4, 2, 2, 4, 0)
    return place


def digest(folder: Path) -> dict[str, str]:
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_every_episode_is_a_reach_from_home_to_its_berry(folder: Path) -> None:
    demonstrations = read_demos(folder)
    assert demonstrations.info["poses_of"] == "flange"
    assert [len(indices) for indices in demonstrations.targets.values()] == [2, 2]
    for episode in demonstrations:
        assert episode.joints is not None
        assert episode.poses is not None
        assert episode.target is not None
        assert episode.target.picking_point is not None
        assert len(episode.joints) == 60
        np.testing.assert_allclose(episode.joints.values[0], HOME, atol=1e-9)
        tip = ARM.forward_kinematics_tool(episode.joints.end)[:3, 3]
        assert np.linalg.norm(tip - episode.target.picking_point) < 1e-4
        flange = ARM.forward_kinematics(np.array(episode.joints.values))
        np.testing.assert_allclose(flange[:, :3, 3], episode.poses.values[:, :3], atol=1e-9)
        assert 1.0 < episode.joints.duration < 10.0
        assert episode.extra["separation_fingers"] == "open"
    report = validate_demos(folder, limits=PANDA_LIMITS, forward_kinematics=ARM.forward_kinematics)
    assert report.faults == ()


def test_the_one_ripe_berry_is_in_the_box(folder: Path) -> None:
    for episode in read_demos(folder):
        assert episode.home is not None
        assert episode.target is not None
        frame = episode.home.frame()
        assert frame.depth is not None
        assert (frame.height, frame.width) == (480, 640)
        x0, y0, x1, y1 = episode.target.box.astype(int)
        red = (frame.rgb[..., 0].astype(int) - frame.rgb[..., 1]) > 70
        assert red[y0:y1, x0:x1].sum() > 150
        # the picking point projects into the box, at the depth that was measured around it
        assert frame.T_base_camera is not None
        point = np.linalg.solve(frame.T_base_camera, np.append(episode.target.picking_point, 1.0))  # type: ignore[arg-type]
        u, v = (615.0 * point[:2] / point[2] + [319.5, 239.5]).tolist()
        assert x0 - 1 <= u <= x1 + 1
        assert y0 - 1 <= v <= y1 + 1
        inside = frame.depth[y0:y1, x0:x1]
        assert abs(np.median(inside[inside > 0]) - point[2]) < 0.25
        assert (mark_target(frame.rgb, episode.target.box)[y0 + 1 : y1 - 1, x0 + 1 : x1 - 1] == 255).all()


def test_photographs_of_repeats_differ_by_noise_alone(folder: Path) -> None:
    first, second = (
        episode.home.rgb().astype(int) for episode in read_demos(folder).subset([0, 1]) if episode.home
    )
    assert 0.3 < np.abs(first - second).mean() < 15.0


def test_same_bytes_whatever_interrupts_it(folder: Path, tmp_path: Path) -> None:
    """Stopped after the first plant and started again, it makes what was made in one go."""

    def stop(done: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    place = tmp_path / "single"
    settings = {"configurations": 2, "repeats": 2, "seed": 4, "samples": 60}
    with pytest.raises(Interrupted) as interrupted:
        simulate_demonstration_set(place, **settings, progress=stop)  # type: ignore[arg-type]
    assert interrupted.value.kept == place
    with pytest.raises(FileFormatError, match="not complete"):
        read_demos(place)
    with pytest.raises(OutputExistsError, match="begun with seed 4"):
        simulate_demonstration_set(place, **(settings | {"seed": 5}))  # type: ignore[arg-type]
    report = simulate_demonstration_set(place, **settings)  # type: ignore[arg-type]
    assert (report.made, report.kept) == (2, 2)
    assert digest(place) == digest(folder)
    with pytest.raises(OutputExistsError, match="complete"):
        simulate_demonstration_set(place, **settings)  # type: ignore[arg-type]


def test_folders_of_others_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("the only copy")
    for force in (False, True):
        with pytest.raises(OutputExistsError, match="is no set of demonstrations"):
            simulate_demonstration_set(tmp_path, configurations=1, repeats=1, force=force)
    (tmp_path / "demonstrations.json").write_text(json.dumps({"schema": "other"}))
    with pytest.raises(FileFormatError, match="no description"):
        simulate_demonstration_set(tmp_path, configurations=1, repeats=1, force=True)
    assert (tmp_path / "thesis.txt").exists()


@pytest.mark.parametrize(
    "settings",
    [
        {"configurations": 0},
        {"repeats": 0},
        {"samples": 1},
        {"scene": "triple"},
        {"spread": "none"},
        {"workers": 0},
    ],
)
def test_settings_out_of_range(tmp_path: Path, settings: dict[str, int]) -> None:
    with pytest.raises(ConfigurationError, match="demonstrations:"):
        simulate_demonstration_set(tmp_path / "out", **settings)  # type: ignore[arg-type]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("seed", [0, 1])
def test_a_single_plant_has_one_ripe_berry_in_the_whole_world(seed: int) -> None:
    scene = grow_scene(np.random.default_rng([0, seed]), "single")
    world = build_world(scene.world_seed, WorldConfig(cluster=scene.config, arm_visuals=False))
    ripe = [berry.index for berry in world.cluster.berries if berry.berry.stage.pluckable]
    assert ripe == scene.berries.ids[scene.targets].tolist()
    assert len(world.cluster.berries) > 1
    np.testing.assert_allclose(true_picking_points(world)[ripe], scene.grip_points)


def test_a_plant_with_several_targets() -> None:
    scene = grow_scene(np.random.default_rng(2), "multi", 3)
    assert scene.boxes.shape == (3, 4)
    assert len(set(scene.targets.tolist())) == 3
    assert (scene.berries.classes[scene.targets] == 0).all()
    distances = np.linalg.norm(scene.grip_points[:, None] - scene.grip_points, axis=2)[np.triu_indices(3, 1)]
    assert distances.min() > 0.01
    frame = photograph_scene(scene, np.random.default_rng(0))
    assert frame.depth is not None
    assert (frame.depth > 0).mean() > 0.5
    with pytest.raises(ConfigurationError, match="single"):
        grow_scene(np.random.default_rng(2), "single", 2)
