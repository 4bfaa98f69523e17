from __future__ import annotations

import numpy as np
import pytest

from punnet.errors import ShapeError
from punnet.scene import Strawberries
from punnet.scene.overlay import CLASS_COLOURS, draw_overlay


def berries(size: tuple[int, int] = (240, 320), n: int = 2) -> Strawberries:
    masks = np.zeros((n, *size), bool)
    boxes = np.zeros((n, 4))
    points = np.zeros((n, 5, 2))
    for i in range(n):
        left = 40 + 120 * i
        masks[i, 100:150, left : left + 40] = True
        boxes[i] = (left, 85, left + 40, 150)
        points[i] = [(left + 20, 85), (left + 20, 100), (left + 20, 149), (left, 120), (left + 39, 120)]
    return Strawberries(
        image_size=size,
        boxes=boxes,
        classes=np.arange(n) % 2,
        masks=masks,
        keypoints=points,
        visibility=np.tile([2, 1, 3, 2, 2], (n, 1)),
        ripeness=np.linspace(1, 0, n),
        weights=np.full(n, 21.0),
    )


def test_draws_over_a_copy() -> None:
    image = np.full((240, 320, 3), 90, np.uint8)
    picture = draw_overlay(image, berries())
    assert (image == 90).all()
    assert picture.shape == image.shape
    assert picture.dtype == np.uint8


def test_masks_are_tinted_in_the_class_colour() -> None:
    picture = draw_overlay(np.full((240, 320, 3), 90, np.uint8), berries())
    for colour, pixel in zip(CLASS_COLOURS, (picture[140, 50], picture[140, 170]), strict=True):
        toward = np.sign(np.array(colour) - 90)
        assert (np.sign(pixel.astype(int) - 90) == toward).all()
    assert (picture[200, 300] == 90).all()


def test_visible_and_hidden_points_look_different() -> None:
    found = berries(n=1)
    image = np.zeros((240, 320, 3), np.uint8)
    pictures = [
        draw_overlay(image, found.with_fields(visibility=np.full((1, 5), code))) for code in (1, 2, 3)
    ]
    assert not np.array_equal(pictures[0], pictures[1])
    assert not np.array_equal(pictures[1], pictures[2])


def test_unsure_unpluckable_berries_carry_no_label() -> None:
    image = np.zeros((240, 320, 3), np.uint8)
    found = berries(n=1).with_fields(classes=np.array([1]), masks=None, keypoints=None, visibility=None)
    unsure = draw_overlay(image, found.with_fields(scores=np.array([0.3])))
    sure = draw_overlay(image, found.with_fields(scores=np.array([0.8])))
    assert (sure != unsure).any()
    assert not unsure[:80].any()


@pytest.mark.parametrize("size", [(1, 1), (16, 16), (30, 400)])
def test_tiny_pictures_work(size: tuple[int, int]) -> None:
    found = Strawberries(image_size=size, boxes=np.array([[0.0, 0.0, size[1], size[0]]]))
    assert draw_overlay(np.zeros((*size, 3), np.uint8), found).shape == (*size, 3)


def test_no_berries_no_change() -> None:
    image = np.random.default_rng(0).integers(0, 256, (40, 50, 3), dtype=np.uint8)
    assert np.array_equal(draw_overlay(image, Strawberries.empty((40, 50))), image)


def test_labels_of_a_crowd_stay_in_the_picture() -> None:
    boxes = np.array([[u, v, u + 6.0, v + 6] for u in range(0, 310, 20) for v in range(0, 230, 20)])
    crowd = Strawberries(image_size=(240, 320), boxes=boxes)
    assert draw_overlay(np.zeros((240, 320, 3), np.uint8), crowd).any()


def test_another_size_is_refused() -> None:
    with pytest.raises(ShapeError, match="overlay"):
        draw_overlay(np.zeros((10, 10, 3), np.uint8), berries())


def test_given_labels_are_written_for_every_berry() -> None:
    found = berries().with_fields(scores=np.array([0.9, 0.1]))
    image = np.full((240, 320, 3), 90, np.uint8)
    plain = draw_overlay(image, found, labels=["1", "2"])
    other = draw_overlay(image, found, labels=["1", "3"])
    changed = np.argwhere((plain != other).any(axis=2))
    assert len(changed)
    assert changed[:, 1].min() > 120  # beside the second berry, unsure and unpluckable as it is
    with pytest.raises(ShapeError, match="1 labels for 2"):
        draw_overlay(image, found, labels=["1"])
