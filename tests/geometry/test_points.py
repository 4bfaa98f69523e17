import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ShapeError
from punnet.geometry import CameraIntrinsics, back_project, cloud_from_depth, project

CAMERA = CameraIntrinsics(64, 48, 60.0, 61.0, 31.5, 23.5)


@settings(deadline=None, max_examples=50)
@given(st.floats(0, 63), st.floats(0, 47), st.floats(0.05, 9.0))
def test_projection_undoes_back_projection(u, v, depth):
    assert np.allclose(project(CAMERA, back_project(CAMERA, [u, v], depth)), [u, v], atol=1e-9)


def test_the_optical_frame_has_x_right_and_y_down():
    u, v = project(CAMERA, [0.1, 0.2, 1.0])
    assert u > CAMERA.cx
    assert v > CAMERA.cy


def test_points_behind_the_camera_have_no_pixel():
    assert np.isnan(project(CAMERA, [[0, 0, -1.0], [0, 0, 0.0]])).all()


def test_clouds_leave_out_pixels_without_reading():
    depth = np.zeros((48, 64), dtype=np.float32)
    depth[10, 20] = 0.5
    depth[11, 20] = 0.6
    assert len(cloud_from_depth(CAMERA, depth)) == 2
    mask = np.zeros((48, 64), dtype=bool)
    mask[10, 20] = True
    assert np.allclose(cloud_from_depth(CAMERA, depth, mask), back_project(CAMERA, [[20, 10]], [0.5]))
    with pytest.raises(ShapeError, match="camera says"):
        cloud_from_depth(CAMERA, depth[:10])
