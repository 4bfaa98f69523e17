"""Rendering: exact pixels, metric depth, what is hidden, back ends, resources."""

from __future__ import annotations

import os
import subprocess
import sys

import mujoco
import numpy as np
import pytest

from punnet.errors import ConfigurationError, RenderingError
from punnet.geometry import CameraIntrinsics, project, transform_points
from punnet.sim import gl_context
from punnet.sim.rendering import CameraRenderer, gl_backend

D435I = CameraIntrinsics(640, 480, 615.0, 615.0, 319.5, 239.5)
T_WORLD_CAMERA = np.array(
    [
        [0.0, -0.2, 0.9797958971132712, 0.1],
        [-1.0, 0.0, 0.0, -0.2],
        [0.0, -0.9797958971132712, -0.2, 0.6],
        [0, 0, 0, 1],
    ]
)
POINTS = np.array(
    [
        [0.0, 0.0, 0.4],
        [0.12, 0.07, 0.45],
        [-0.15, 0.10, 0.38],
        [0.10, -0.09, 0.60],
        [-0.2, -0.15, 0.5],
        [0.02, 0.0, 0.3],
    ]
)
RADIUS = 0.004


def _spec() -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    spec.worldbody.add_light(
        pos=(0, 0, 2), dir=(0.3, 0, -1), type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, castshadow=True
    )
    opengl = T_WORLD_CAMERA[:3, :3] @ np.diag((1.0, -1.0, -1.0))
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, opengl.ravel())
    spec.worldbody.add_camera(
        name="wrist",
        pos=T_WORLD_CAMERA[:3, 3],
        quat=quaternion,
        fovy=np.degrees(2 * np.arctan(240 / 615.0)),
    )
    for number, point in enumerate(transform_points(T_WORLD_CAMERA, POINTS)):
        spec.worldbody.add_geom(
            name=f"ball{number}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=(RADIUS, 0, 0),
            pos=point,
            group=number % 3,
        )
    return spec


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return _spec().compile()


@pytest.fixture(scope="module")
def data(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


def test_a_known_point_is_drawn_where_the_intrinsics_project_it(
    model: mujoco.MjModel, data: mujoco.MjData
) -> None:
    with CameraRenderer(model) as renderer:
        view = renderer.render_all(data, "wrist")
    pixels = project(D435I, POINTS)
    for number, (u, v) in enumerate(pixels):
        rows, columns = np.nonzero(view.segmentation == model.geom(f"ball{number}").id)
        # The outline of a small ball is centred on its projection to a few hundredths of a pixel.
        assert columns.mean() == pytest.approx(u, abs=0.25)
        assert rows.mean() == pytest.approx(v, abs=0.25)


def test_depth_is_metric_along_the_optical_axis(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    with CameraRenderer(model) as renderer:
        depth = renderer.render_depth(data, "wrist")
    assert depth.dtype == np.float32
    for (u, v), point in zip(project(D435I, POINTS), POINTS, strict=True):
        nearest = point * (1 - RADIUS / np.linalg.norm(point))  # where the ray to the centre meets the ball
        assert depth[round(v), round(u)] == pytest.approx(nearest[2], abs=1e-3)
    assert depth[2, 2] == 0.0  # nothing there


def test_a_flat_wall_has_one_depth_over_the_whole_picture() -> None:
    spec = _spec()
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, (T_WORLD_CAMERA[:3, :3] @ np.diag((1.0, -1.0, -1.0))).ravel())
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=(2, 2, 0.1),
        pos=transform_points(T_WORLD_CAMERA, np.array([[0.0, 0.0, 0.8]]))[0],
        quat=quaternion,
        name="wall",
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with CameraRenderer(model) as renderer:
        view = renderer.render_all(data, 0)
    wall = view.segmentation == model.geom("wall").id
    assert wall.mean() > 0.9
    np.testing.assert_allclose(view.depth[wall], 0.8, atol=2e-5)


def test_masks_and_depth_come_from_the_same_samples(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    with CameraRenderer(model) as renderer:
        view = renderer.render_all(data, "wrist")
        rgb, depth = renderer.render_rgbd(data, "wrist")
        np.testing.assert_array_equal((view.segmentation >= 0), view.depth > 0)
        np.testing.assert_array_equal(view.depth, depth)
        np.testing.assert_array_equal(view.rgb, rgb)
        np.testing.assert_array_equal(view.rgb, renderer.render_rgb(data, "wrist"))
        np.testing.assert_array_equal(view.segmentation, renderer.render_segmentation(data, "wrist"))
    assert view.rgb.shape == (480, 640, 3)
    assert view.rgb.dtype == np.uint8
    assert view.segmentation.dtype == np.int32


def test_hidden_groups_are_not_drawn(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    with CameraRenderer(model, hidden_groups=(2,)) as renderer:
        shown = np.unique(renderer.render_segmentation(data, "wrist"))
    ids = {model.geom(f"ball{n}").id for n in range(6) if n % 3 != 2}
    assert set(shown.tolist()) == ids | {-1}


def test_results_belong_to_the_caller(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    with CameraRenderer(model) as renderer:
        first = renderer.render_all(data, "wrist")
        copy = first.depth.copy()
        renderer.render_all(data, mujoco.MjvCamera())
    np.testing.assert_array_equal(first.depth, copy)


def test_two_renderers_of_different_sizes_take_turns(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    with CameraRenderer(model) as wide, CameraRenderer(model, 64, 48, samples=0) as small:
        for _ in range(2):
            assert wide.render_rgb(data, "wrist").shape == (480, 640, 3)
            assert small.render_rgb(data, "wrist").shape == (48, 64, 3)
    assert model.vis.quality.offsamples == 4  # the caller's model is as it was


def test_a_picture_may_be_larger_than_the_models_own_buffer(
    model: mujoco.MjModel, data: mujoco.MjData
) -> None:
    with CameraRenderer(model, 1024, 768) as renderer:
        assert (renderer.render_segmentation(data, "wrist")[400:] >= 0).any()


def test_making_many_renderers_does_not_leak(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    def resident_kilobytes() -> int:
        with open("/proc/self/statm") as file:  # noqa: PTH123
            return int(file.read().split()[1]) * 4

    if not sys.platform.startswith("linux"):
        pytest.skip("needs /proc")
    for _ in range(2):
        with CameraRenderer(model, 160, 120) as renderer:
            renderer.render_rgb(data, "wrist")
    before = resident_kilobytes()
    for _ in range(10):
        with CameraRenderer(model, 160, 120) as renderer:
            renderer.render_rgb(data, "wrist")
    # A leaked context would keep at least its 4 MB shadow map (1024², 4 bytes).
    assert resident_kilobytes() - before < 20_000


def test_a_closed_renderer_says_so(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    renderer = CameraRenderer(model, 32, 24)
    renderer.close()
    renderer.close()
    with pytest.raises(RenderingError, match="closed"):
        renderer.render_rgb(data, "wrist")


@pytest.mark.parametrize("camera", ["elbow", 7, -1])
def test_an_unknown_camera_is_named(model: mujoco.MjModel, data: mujoco.MjData, camera: int | str) -> None:
    with (
        CameraRenderer(model, 32, 24) as renderer,
        pytest.raises(ConfigurationError, match=r"not in this model; it has \['wrist'\]"),
    ):
        renderer.render_rgb(data, camera)


def test_sizes_and_groups_are_checked(model: mujoco.MjModel) -> None:
    with pytest.raises(ConfigurationError, match="positive"):
        CameraRenderer(model, 0, 480)
    with pytest.raises(ConfigurationError, match="groups"):
        CameraRenderer(model, hidden_groups=(6,))


def test_without_any_back_end_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = {name: (lambda: "not installed") for name in ("egl", "osmesa", "glfw")}
    monkeypatch.setattr(gl_context, "_LINUX_PROBES", missing)
    monkeypatch.setattr(gl_context, "_DARWIN_PROBES", missing)
    monkeypatch.setattr(gl_context.platform, "system", lambda: "Linux")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    gl_backend.cache_clear()
    try:
        with pytest.raises(RenderingError) as caught:
            gl_backend()
    finally:
        gl_backend.cache_clear()
    for word in ("libegl1", "libgl1-mesa-dri", "libosmesa6", "apt-get install"):
        assert word in str(caught.value)


@pytest.mark.parametrize(("value", "words"), [("off", "switched off"), ("vulkan", "not known here")])
def test_mujoco_gl_is_honoured(monkeypatch: pytest.MonkeyPatch, value: str, words: str) -> None:
    monkeypatch.setenv("MUJOCO_GL", value)
    gl_backend.cache_clear()
    try:
        with pytest.raises(RenderingError, match=words):
            gl_backend()
    finally:
        gl_backend.cache_clear()


def test_a_library_that_is_not_there_is_missed_before_mujoco_trips_over_it() -> None:
    """In a process of its own, where the loader finds no library at all."""
    program = (
        "import ctypes.util\n"
        "ctypes.util.find_library = lambda name: None\n"
        "from punnet.sim import gl_context\n"
        "gl_context.ctypes.CDLL = lambda name: (_ for _ in ()).throw(OSError(name))\n"
        "try:\n    gl_context.gl_backend()\n"
        "except gl_context.RenderingError as error:\n    print(error)\n"
    )
    environment = {name: value for name, value in os.environ.items() if name != "MUJOCO_GL"}
    result = subprocess.run(
        [sys.executable, "-c", program],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert "apt-get install" in result.stdout
    assert "libEGL.so.1 is not installed" in result.stdout or sys.platform == "darwin"
