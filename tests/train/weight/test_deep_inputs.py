from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from punnet.errors import ConfigurationError
from punnet.train.weight.augmentation import move_points
from punnet.train.weight.deep_config import DeepConfig, ImageConfig, PointConfig
from punnet.train.weight.deep_inputs import PictureInputs, PointInputs, berry_picture
from punnet.weight.observation import BerryObservation
from tests.train.weight.domes import dome

POINTS = PointConfig(points=64, pool=256)
ALL = np.arange(2)


def of_points(berry: BerryObservation, cloud: np.ndarray) -> BerryObservation:
    return replace(berry, cloud=cloud)


def test_points_are_centred_across_and_keep_their_depth() -> None:
    near, far = dome(distance=0.25), dome(distance=0.45, centre=(90, 60))
    inputs = PointInputs([near, far], POINTS)
    still = inputs.still(ALL)
    assert still.shape == (2, 64, 4)
    assert still[:, :, :2].mean(dim=1).abs().max() < 0.25
    for row, berry in zip(still, (near, far), strict=True):
        depth = (float(row[0, 3]) + 1) / 2 * 0.5 + 0.15
        assert depth == pytest.approx(np.median(berry.cloud[:, 2]), abs=1e-6)
        assert (row[:, 3] == row[0, 3]).all()


@pytest.mark.parametrize("source", ["cloud", "surface"])
def test_points_do_not_depend_on_the_order_of_the_cloud(source: str) -> None:
    berry = dome()
    shuffled = of_points(berry, np.random.default_rng(1).permutation(berry.cloud))
    config = replace(POINTS, source=source)
    still = PointInputs([berry, shuffled], config).still(ALL)
    torch.testing.assert_close(still[0], still[1], rtol=0, atol=0)


@pytest.mark.parametrize("source", ["cloud", "surface"])
def test_points_do_not_depend_on_where_in_the_image_they_are(source: str) -> None:
    berry = dome()
    moved = of_points(berry, berry.cloud + np.array((0.04, -0.03, 0.0)))
    config = replace(POINTS, source=source, points=256)
    still = PointInputs([berry, moved], config).still(ALL)
    for axis in range(3):
        quantiles = [row[:, axis].quantile(torch.tensor([0.1, 0.5, 0.9])) for row in still]
        torch.testing.assert_close(quantiles[0], quantiles[1], rtol=0, atol=0.15)


@pytest.mark.parametrize("points", [1, 3, 20])
@pytest.mark.parametrize("source", ["cloud", "surface"])
def test_few_points_are_used_again(points: int, source: str) -> None:
    berry = dome()
    few = of_points(berry, berry.cloud[:: len(berry.cloud) // points][:points])
    still = PointInputs([few], replace(POINTS, source=source)).still(np.array([0]))
    assert still.shape == (1, 64, 4)
    assert torch.isfinite(still).all()
    if source == "cloud":
        assert len(torch.unique(still[0], dim=0)) == points


def test_an_epoch_draws_other_points_moved_across_but_not_in_depth() -> None:
    inputs = PointInputs([dome(), dome(distance=0.4)], replace(POINTS, tilt=0.0, roll=0.0))
    generator = np.random.default_rng(0)
    draws = [inputs.draw(ALL, generator) for _ in range(20)]
    still = inputs.still(ALL)
    assert not torch.equal(draws[0], draws[1])
    for drawn in draws:
        torch.testing.assert_close(drawn[..., 3], still[..., 3])
    middles = torch.stack([drawn.mean(dim=1) for drawn in draws])
    assert middles[:, :, :2].std(dim=0).min() > 0.05  # 5 mm of 20, evenly: 0.14
    assert (middles[:, :, 2] - still[:, :, 2].mean(dim=1)).abs().max() < 0.2


def test_turning_keeps_distances_and_the_middle() -> None:
    points = np.random.default_rng(2).normal(size=(4, 30, 3)).astype(np.float32)
    points -= points.mean(axis=1, keepdims=True)
    moved = move_points(points, np.random.default_rng(0), shift=0.5, tilt=20.0, roll=90.0)
    middle = moved.mean(axis=1)
    assert np.abs(middle[:, 2]).max() < 1e-5
    assert np.abs(middle[:, :2]).max() <= 0.5 + 1e-5
    assert np.abs(middle[:, :2]).min() > 1e-3
    before = np.linalg.norm(points[:, :, None] - points[:, None], axis=3)
    after = np.linalg.norm(moved[:, :, None] - moved[:, None], axis=3)
    np.testing.assert_allclose(after, before, atol=1e-5)
    assert np.abs(moved - middle[:, None] - points).max() > 0.1


def test_turns_keep_within_their_limits() -> None:
    axes = np.repeat(np.eye(3, dtype=np.float32)[None], 200, axis=0)
    moved = move_points(axes, np.random.default_rng(0), shift=0.0, tilt=0.0, roll=30.0)
    angles = np.degrees(np.arctan2(moved[:, 0, 1], moved[:, 0, 0]))
    assert -30 <= angles.min() < -25 < 25 < angles.max() <= 30
    np.testing.assert_allclose(moved[:, 2], axes[:, 2], atol=1e-6)


def test_pictures_show_the_berry_alone_at_its_apparent_size() -> None:
    config = ImageConfig(pixels=96)
    berry = dome(radius=0.015, length=0.02, distance=0.3)
    picture = berry_picture(berry, config)
    assert picture.shape == (5, 96, 96)
    shown = picture[3] > 0
    # 2 · 0.015 / 0.3 of 0.3 in 96 pixels is 32; 0.02 gives 42.7.
    assert abs(np.flatnonzero(shown.any(axis=0)).size - 32) <= 1
    assert abs(np.flatnonzero(shown.any(axis=1)).size - 42.7) <= 2.2
    assert not picture[:, ~(picture != 0).any(axis=0)].any()
    assert (picture[:, :10] == 0).all()
    middle = picture[3, 48, 48] * 0.4
    assert middle == pytest.approx(0.285, abs=1e-3)
    assert picture[4, 48, 48] < 0 < picture[4][shown].max()


def test_another_camera_shows_the_same_picture() -> None:
    config = ImageConfig(pixels=96)
    berry = dome()
    finer = replace(
        berry,
        camera=replace(berry.camera, width=640, height=480, fx=600.0, fy=600.0, cx=319.5, cy=239.5),
        rgb=berry.rgb.repeat(2, axis=0).repeat(2, axis=1),
        depth=berry.depth.repeat(2, axis=0).repeat(2, axis=1),
        mask=berry.mask.repeat(2, axis=0).repeat(2, axis=1),
    )
    difference = np.abs(berry_picture(finer, config) - berry_picture(berry, config))
    assert np.median(difference[:4]) < 1e-3
    areas = [(berry_picture(seen, config)[3] > 0).sum() for seen in (berry, finer)]
    assert areas[0] == pytest.approx(areas[1], rel=0.03)


def test_a_berry_larger_than_the_picture_is_cut_off() -> None:
    picture = berry_picture(dome(radius=0.03, length=0.04, distance=0.2), ImageConfig(pixels=48))
    assert (picture[3] > 0).all(axis=0).any()
    assert np.isfinite(picture).all()


def test_pictures_move_and_keep_their_depth() -> None:
    inputs = PictureInputs([dome(), dome(distance=0.4)], ImageConfig(pixels=64, shift=0.1, roll=30.0))
    still, drawn = inputs.still(ALL), inputs.draw(ALL, np.random.default_rng(3))
    assert drawn.shape == still.shape == (2, 5, 64, 64)
    for before, after in zip(still, drawn, strict=True):
        assert after[3].max() == pytest.approx(float(before[3].max()), abs=0.01)
        assert after[3].sum() == pytest.approx(float(before[3].sum()), rel=0.02)
        rows = torch.arange(64.0)
        middles = [(p[3].sum(dim=1) * rows).sum() / p[3].sum() for p in (before, after)]
        assert 0.2 < abs(float(middles[0] - middles[1])) <= 6.5
        # Nothing between berry and background: a moved edge is as sharp as one that was not moved.
        for picture in (before, after):
            shown = picture[3][picture[3] > 0]
            assert shown.min() > 0.9 * shown.max()


def test_a_turn_is_a_turn_about_the_middle() -> None:
    config = ImageConfig(pixels=65)
    berry = dome(radius=0.012, length=0.025)
    still, quarter = berry_picture(berry, config), berry_picture(berry, config, roll=90.0)
    np.testing.assert_allclose(quarter, np.rot90(still, k=-1, axes=(1, 2)), atol=1e-3)
    aside = berry_picture(berry, config, shift=(0.2, -0.2))
    np.testing.assert_allclose(aside[:, :40, 13:], still[:, 13:53, :-13], atol=1e-3)


def test_pictures_stay_without_a_shift_or_roll() -> None:
    inputs = PictureInputs([dome()], ImageConfig(pixels=64, shift=0.0, roll=0.0))
    one = np.array([0])
    torch.testing.assert_close(inputs.draw(one, np.random.default_rng(0)), inputs.still(one), rtol=0, atol=0)


@pytest.mark.parametrize(
    ("kind", "change", "message"),
    [
        (DeepConfig, {"epochs": 0}, "epochs must be positive"),
        (DeepConfig, {"learning_rate": float("nan")}, "learning_rate"),
        (DeepConfig, {"patience": -1}, "patience must be at least 0"),
        (DeepConfig, {"dropout": 1.0}, "dropout"),
        (DeepConfig, {"distances": (0.5, 0.2)}, "distances"),
        (PointConfig, {"source": "mesh"}, "cloud or surface"),
        (PointConfig, {"points": 300, "pool": 200}, "pool"),
        (ImageConfig, {"pixels": 16}, "at least 32"),
    ],
)
def test_impossible_settings_are_refused(kind: type[DeepConfig], change: dict, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        kind(**change)
