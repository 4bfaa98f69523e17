import pytest

from punnet.errors import FileFormatError, ShapeError
from punnet.geometry import CameraIntrinsics


def test_json_round_trip_and_realsense_names():
    camera = CameraIntrinsics(640, 480, 615.0, 614.0, 319.5, 239.5)
    assert CameraIntrinsics.from_json(camera.to_json()) == camera
    realsense = {"width": 640, "height": 480, "fx": 615.0, "fy": 614.0, "ppx": 319.5, "ppy": 239.5}
    assert CameraIntrinsics.from_json(realsense) == camera


@pytest.mark.parametrize("field", ["width", "fx", "cy"])
def test_missing_field_is_named(field):
    data = CameraIntrinsics(640, 480, 615.0, 614.0, 319.5, 239.5).to_json()
    del data[field]
    with pytest.raises(FileFormatError, match=f"cam.json: '{field}' is missing"):
        CameraIntrinsics.from_json(data, where="cam.json")


@pytest.mark.parametrize("bad", [{"width": 0}, {"fx": -1.0}, {"fy": float("nan")}, {"cx": float("inf")}])
def test_impossible_cameras_are_refused(bad):
    values = {"width": 640, "height": 480, "fx": 615.0, "fy": 615.0, "cx": 0.0, "cy": 0.0, **bad}
    with pytest.raises(ShapeError):
        CameraIntrinsics(**values)
