from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError
from punnet.perception.regions import RegionConfig, depth_edges
from punnet.perception.watershed import region_contacts, solidity, split_touching


def discs(*circles: tuple[int, int, int]) -> np.ndarray:
    mask = np.zeros((140, 200), np.uint8)
    for u, v, radius in circles:
        cv2.circle(mask, (u, v), radius, 1, cv2.FILLED)
    return mask


def split(mask: np.ndarray) -> np.ndarray:
    return split_touching(mask, neck=0.85, convex=0.87)


def test_one_disc_stays_whole() -> None:
    assert split(discs((100, 70, 30))).max() == 1


def test_two_discs_are_parted_at_the_neck() -> None:
    labels = split(discs((75, 70, 25), (118, 70, 25)))
    assert labels.max() == 2
    assert labels[70, 70] != labels[70, 125]
    # The border runs midway between the centres.
    assert labels[70, 92] == labels[70, 75]
    assert labels[70, 101] == labels[70, 118]


def test_cloverleaf_is_three() -> None:
    labels = split(discs((75, 50, 24), (120, 50, 24), (98, 88, 24)))
    assert len({labels[50, 70], labels[50, 125], labels[95, 98]}) == 3


def test_tiny_region_is_returned_as_it_is() -> None:
    mask = np.zeros((10, 10), np.uint8)
    mask[4:6, 4:6] = 1
    assert np.array_equal(split(mask), mask)


@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(40, 160), st.integers(40, 100), st.integers(5, 30)), min_size=1, max_size=5
    )
)
def test_every_pixel_gets_one_label(circles: list[tuple[int, int, int]]) -> None:
    mask = discs(*circles)
    labels = split(mask)
    assert np.array_equal(labels > 0, mask > 0)
    assert set(np.unique(labels)) - {0} == set(range(1, labels.max() + 1))


def test_solidity_of_known_shapes() -> None:
    assert solidity(discs((100, 70, 40))) > 0.97
    half = np.zeros((60, 60), np.uint8)
    half[10:50, 10:50] = 1
    assert solidity(half) == pytest.approx(1.0, abs=0.01)
    half[10:30, 30:50] = 0
    # An L of three quarters of a square fills 3/4 of 7/8 of it.
    assert solidity(half) == pytest.approx(6 / 7, abs=0.02)


def test_contacts_count_shared_borders() -> None:
    labels = np.zeros((6, 6), np.int32)
    labels[:3, :3], labels[3:, :3], labels[:, 4:] = 1, 2, 3
    assert region_contacts(labels, 1) == {(1, 2): 3}
    assert region_contacts(labels, 2) == {(1, 2): 6, (1, 3): 3, (2, 3): 3}


def test_depth_edges_ignore_missing_readings() -> None:
    depth = np.full((8, 10), 0.5, np.float32)
    depth[:, 5:] = 0.55
    depth[2, 2] = 0.0
    edges = depth_edges(depth, 0.02)
    assert edges[:, 4:6].all()
    assert not edges[:, :4].any()
    assert not depth_edges(np.zeros((4, 4), np.float32), 0.02).any()


def test_shares_out_of_range_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="neck"):
        RegionConfig(neck=1.5)
