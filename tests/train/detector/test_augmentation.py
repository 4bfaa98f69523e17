"""Image, masks, key-points and boxes move together."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from punnet.scene import KEYPOINTS, Visibility
from punnet.train.detector.augmentation import Labels, change_light, random_view, view
from tests.train.detector.berries import SIZE, draw_berry

HEIGHT, WIDTH = SIZE
MIDDLE = np.array([WIDTH / 2, HEIGHT / 2])
LEFT, RIGHT = KEYPOINTS.index("left_grasp"), KEYPOINTS.index("right_grasp")
EVERYTHING = np.array([[0.0, 0.0, WIDTH, HEIGHT]])

views = st.fixed_dictionaries(
    {
        "factor": st.floats(0.5, 2.0),
        "angle": st.floats(-30.0, 30.0),
        "mirrored": st.booleans(),
    }
)
places = st.tuples(st.integers(8, WIDTH - 9), st.integers(8, HEIGHT - 9))


def one_berry(centre: tuple[int, int] = (64, 45), radius: int = 14) -> tuple[NDArray[np.uint8], Labels]:
    """A drawn berry and its labels."""
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    drawn = draw_berry(image, centre, radius, class_index=0, number=1)
    mask = (image[..., 0] == 190).astype(np.uint8)
    assert drawn.keypoints is not None
    assert drawn.visibility is not None
    return image, Labels(
        boxes=drawn.box[None],
        classes=np.array([0]),
        masks=mask[None],
        has_mask=np.array([True]),
        keypoints=drawn.keypoints[None],
        allowed=np.eye(len(Visibility), dtype=np.bool_)[drawn.visibility][None],
        ripeness=np.array([0.9]),
        ignored=np.zeros((0, 4)),
    )


def dot(place: tuple[int, int]) -> NDArray[np.uint8]:
    """A soft white dot on black."""
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    cv2.circle(image, place, 2, (255, 255, 255), -1)
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 1.2), dtype=np.uint8)


@settings(max_examples=60, deadline=None)
@given(how=views, place=places, centre=places)
def test_keypoints_move_with_the_image(
    how: dict[str, float], place: tuple[int, int], centre: tuple[int, int]
) -> None:
    _, labels = one_berry()
    points = np.full((1, 5, 2), np.nan)
    points[0, 0] = place
    # An unmasked box over the whole image, so that it is kept whatever the view.
    labels = replace(labels, keypoints=points, boxes=EVERYTHING, has_mask=np.array([False]))
    seen, moved = view(dot(place), labels, SIZE, np.array(centre, dtype=np.float64), **how)
    assume(len(moved))
    expected = moved.keypoints[0, 0]
    assume(
        np.isfinite(expected).all() and (expected > 5).all() and (expected < (WIDTH - 6, HEIGHT - 6)).all()
    )
    left, top = np.rint(expected).astype(int) - 4
    window = seen[top : top + 9, left : left + 9, 0].astype(np.float64)
    v, u = np.mgrid[top : top + 9, left : left + 9]
    assert window.sum() > 0
    found = np.array([(window * u).sum(), (window * v).sum()]) / window.sum()
    assert np.linalg.norm(found - expected) < 1.0


@settings(max_examples=40, deadline=None)
@given(how=views, shift=st.tuples(st.floats(-20, 20), st.floats(-20, 20)))
def test_masks_cover_the_fruit_and_boxes_hold_them(how: dict[str, float], shift: tuple[float, float]) -> None:
    image, labels = one_berry()
    seen, moved = view(image, labels, SIZE, MIDDLE + np.array(shift), **how)
    assume(len(moved))
    mask = moved.masks[0].astype(bool)
    v, u = np.nonzero(mask)
    known = moved.keypoints[0][np.isfinite(moved.keypoints[0]).all(axis=1)]
    low = np.minimum((u.min(), v.min()), known.min(axis=0, initial=np.inf))
    high = np.maximum((u.max() + 1, v.max() + 1), known.max(axis=0, initial=-np.inf))
    np.testing.assert_allclose(moved.boxes[0], np.concatenate((low, high)))
    inner = cv2.erode(mask.astype(np.uint8), np.ones((5, 5))) > 0
    assert (seen[inner][:, 0] > 120).all(), "the mask covers what is red in the image"
    # Reflected at the image's edge, the fruit may be seen twice: where the mask is not, near it, there is none.
    around = (cv2.dilate(mask.astype(np.uint8), np.ones((9, 9))) > 0) & ~(
        cv2.dilate(mask.astype(np.uint8), np.ones((5, 5))) > 0
    )
    assert np.mean(seen[around][:, 0] > 150) < 0.02


def test_mirrored_twice_is_where_it_was() -> None:
    image, labels = one_berry((40, 50))
    labels = replace(labels, ignored=np.array([[3.0, 4.0, 20.0, 30.0]]))
    once, labels_once = view(image, labels, SIZE, MIDDLE, mirrored=True)
    again, twice = view(once, labels_once, SIZE, MIDDLE, mirrored=True)
    np.testing.assert_array_equal(again, image)
    np.testing.assert_array_equal(once, image[:, ::-1])
    np.testing.assert_array_equal(labels_once.masks, labels.masks[:, :, ::-1])
    for name in ("masks", "has_mask", "keypoints", "allowed", "classes", "ripeness", "ignored"):
        np.testing.assert_allclose(getattr(twice, name), getattr(labels, name), atol=1e-9, err_msg=name)


def test_left_stays_left_in_a_mirror() -> None:
    image, labels = one_berry((40, 50))
    allowed = labels.allowed.copy()
    allowed[0, LEFT] = np.arange(4) == Visibility.HIDDEN_BY_OTHER
    _, moved = view(image, replace(labels, allowed=allowed), SIZE, MIDDLE, mirrored=True)
    assert moved.keypoints[0, LEFT, 0] < moved.keypoints[0, RIGHT, 0]
    # What was the left grasp point, hidden, is now on the right.
    assert moved.allowed[0, RIGHT].tolist() == [False, False, False, True]
    assert moved.keypoints[0, RIGHT, 0] == pytest.approx(WIDTH - 1 - labels.keypoints[0, LEFT, 0])


@pytest.mark.parametrize("mirrored", [False, True])
def test_boxes_without_masks_move_as_those_with(mirrored: bool) -> None:
    image, labels = one_berry((40, 50))
    bare = replace(labels, keypoints=np.full((1, 5, 2), np.nan))
    bare = replace(bare, boxes=np.array([[*box_of(labels.masks[0])]]))
    centre = MIDDLE + np.array([5.0, -3.0])
    _, with_mask = view(image, bare, SIZE, centre, mirrored=mirrored)
    no_mask = replace(bare, has_mask=np.array([False]), masks=np.zeros_like(bare.masks))
    _, without = view(image, no_mask, SIZE, centre, mirrored=mirrored)
    np.testing.assert_allclose(without.boxes, with_mask.boxes)
    assert not without.has_mask.any()
    assert not without.masks.any()


def box_of(mask: NDArray[np.uint8]) -> tuple[float, float, float, float]:
    v, u = np.nonzero(mask)
    return float(u.min()), float(v.min()), float(u.max() + 1), float(v.max() + 1)


def test_a_berry_that_is_mostly_cut_off_is_ignored() -> None:
    image, labels = one_berry((64, 45), radius=14)
    # The crop begins eleven pixels right of the berry's centre: a sliver stays.
    _, sliver = view(image, labels, SIZE, np.array([75 + WIDTH / 2, HEIGHT / 2]))
    assert len(sliver) == 0
    assert len(sliver.ignored) == 1
    assert sliver.ignored[0, 0] == 0
    _, half = view(image, labels, SIZE, np.array([64 + WIDTH / 2, HEIGHT / 2]))
    assert len(half) == 1
    assert len(half.ignored) == 0
    # What left the picture is absent from now on; what stayed is where it was.
    assert np.isnan(half.keypoints[0, LEFT]).all()
    assert half.allowed[0, LEFT].tolist() == [True, False, False, False]
    assert half.keypoints[0, RIGHT, 0] == pytest.approx(labels.keypoints[0, RIGHT, 0] - 64)
    _, gone = view(image, labels, SIZE, np.array([3.0 * WIDTH, HEIGHT / 2]))
    assert len(gone) == len(gone.ignored) == 0


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), crop=st.sampled_from([(64, 96), (96, 64), (128, 160)]))
def test_any_random_view_is_a_fair_sample(seed: int, crop: tuple[int, int]) -> None:
    image, labels = one_berry()
    seen, moved = random_view(np.random.default_rng(seed), image, labels, crop, (0.5, 2.0))
    assert seen.shape == (*crop, 3)
    assert seen.dtype == np.uint8
    assert moved.masks.shape == (len(moved), *crop)
    assert (moved.boxes[:, 2:] > moved.boxes[:, :2]).all()
    assert (moved.boxes >= 0).all()
    assert (moved.boxes <= np.array([crop[1], crop[0]] * 2)).all()
    assert moved.allowed.any(axis=2).all()
    absent = np.isnan(moved.keypoints).all(axis=2)
    assert (moved.allowed[absent].argmax(axis=1) == Visibility.ABSENT).all()
    again, _ = random_view(np.random.default_rng(seed), image, labels, crop, (0.5, 2.0))
    np.testing.assert_array_equal(seen, again)


def test_light_changes_values_and_nothing_else(rng: np.random.Generator) -> None:
    image, _ = one_berry()
    changed = [change_light(rng, image) for _ in range(20)]
    assert all(one.shape == image.shape and one.dtype == np.uint8 for one in changed)
    assert len({one.tobytes() for one in changed}) == 20
    # The berry stays the reddest thing: hue is what tells ripeness.
    red = image[..., 0] == 190
    for one in changed:
        mean = one[red].mean(axis=0)
        assert mean[0] > mean[1] + 30
        assert mean[0] > mean[2] + 30


def test_stronger_light_spreads_exposure_and_saturation_further() -> None:
    image = np.full((40, 40, 3), (110, 70, 60), dtype=np.uint8)

    def spreads(strength: float) -> tuple[float, float]:
        rng = np.random.default_rng(3)
        changed = [change_light(rng, image, strength).astype(float) for _ in range(150)]
        shade = [np.log(one.mean()) for one in changed]
        redness = [one[..., 0].mean() / one.mean() for one in changed]
        return float(np.std(shade)), float(np.std(redness))

    still, usual, strong = spreads(0.0), spreads(1.0), spreads(2.0)
    assert max(still) < 0.02
    for one, other in zip(usual, strong, strict=True):
        assert 1.6 * one < other < 2.5 * one
