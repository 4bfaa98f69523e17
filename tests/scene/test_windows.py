import numpy as np

from punnet.scene.windows import berry_box, mask_box, mask_window


def test_a_window_holds_the_mask_and_the_margin_within_the_image(rng):
    for _ in range(20):
        mask = np.zeros((30, 40), dtype=bool)
        v, u = rng.integers(0, 30, 5), rng.integers(0, 40, 5)
        mask[v, u] = True
        tight = mask_window(mask, 0)
        assert mask[tight].sum() == mask.sum()
        assert (tight[0].start, tight[0].stop, tight[1].start, tight[1].stop) == (
            v.min(),
            v.max() + 1,
            u.min(),
            u.max() + 1,
        )
        wider = np.zeros_like(mask)
        wider[mask_window(mask, 4)] = True
        rows, columns = np.flatnonzero(wider.any(axis=1)), np.flatnonzero(wider.any(axis=0))
        assert (rows[0], rows[-1]) == (max(0, v.min() - 4), min(29, v.max() + 4))
        assert (columns[0], columns[-1]) == (max(0, u.min() - 4), min(39, u.max() + 4))


def test_an_empty_mask_has_an_empty_window():
    mask = np.zeros((30, 40), dtype=bool)
    assert mask[mask_window(mask, 5)].size == 0
    assert mask_window(mask[:, ::2], 5) == mask_window(mask, 5)


def test_a_box_holds_the_mask_and_the_points_that_are_known():
    mask = np.zeros((30, 40), dtype=bool)
    mask[5:9, 10:13] = True
    assert mask_box(mask) == mask_box(mask.astype(np.uint8) * 7) == (10, 5, 13, 9)
    points = np.full((5, 2), np.nan)
    np.testing.assert_array_equal(berry_box(mask, points), (10, 5, 13, 9))
    points[0], points[3] = (11.0, 2.5), (np.nan, 1.0)
    np.testing.assert_array_equal(berry_box(mask, points), (10, 2.5, 13, 9))
    assert berry_box(np.zeros_like(mask), points) is None
