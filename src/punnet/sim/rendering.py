"""Pictures of a MuJoCo scene without a display: colour, metric depth, and which geometry each pixel shows.

One pass draws the colours (with shadows, antialiased); one more, without light, gives depth and geometry ids
together and sampled at pixel centres, so that masks and depth agree pixel by pixel. docs/rendering.md says
what it costs.

Pixel convention: the centre of the top-left pixel is (0, 0). OpenGL puts it at (½, ½), so a MuJoCo camera
with only a field of view has its principal point at ((W − 1)/2, (H − 1)/2): 319.5, 239.5 for 640×480.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, RenderingError
from punnet.sim.gl_context import gl_backend, make_gl_context

__all__ = ["CameraRenderer", "CameraView", "gl_backend"]

DEFAULT_VISIBLE_GROUPS = (0, 1, 2)
BACKGROUND = -1
Camera: TypeAlias = "int | str | mujoco.MjvCamera"


@dataclass(frozen=True, eq=False)
class CameraView:
    """What one camera sees at one instant.

    Parameters
    ----------
    rgb
        (H, W, 3) uint8.
    depth
        (H, W) float32, metres along the optical axis, 0 where nothing is nearer than the far plane.
    segmentation
        (H, W) int32 geometry ids of the model, −1 for the background.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]


class CameraRenderer:
    """Draws the cameras of one model; keeps one OpenGL context for all of its pictures.

    Use it as a context manager, or call :meth:`close`. It must be used in the thread that made it.

    Parameters
    ----------
    model
        The compiled model; its meshes and textures are uploaded once, here.
    width, height
        Picture size in pixels.
    hidden_groups
        Geometry groups not to draw, beside 3–5, which MuJoCo hides by default.
    samples
        Samples per pixel of the colour picture's antialiasing; None takes the model's ``quality.offsamples``.
    shadow_size
        Side of the shadow map in texels; None takes the model's ``quality.shadowsize``. It costs the most.
    max_geometries
        Most geometries in one picture.
    shared_context
        An OpenGL context of :func:`punnet.sim.gl_context.make_gl_context`, at least as large as the picture, that
        outlives this renderer: what compiling shaders costs is then paid once, not once a model. The caller frees it.

    Raises
    ------
    ConfigurationError
        If a size or group is out of its range.
    RenderingError
        If no OpenGL back end works; says what to install.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        width: int = 640,
        height: int = 480,
        *,
        hidden_groups: Collection[int] = (),
        samples: int | None = None,
        shadow_size: int | None = None,
        max_geometries: int = 20_000,
        shared_context: Any = None,
    ) -> None:
        self._gl: Any = None
        self._owns_gl = shared_context is None
        self._context: Any = None
        if width < 1 or height < 1:
            raise ConfigurationError(f"renderer: picture size must be positive, got {width}×{height}")
        if any(group not in range(6) for group in hidden_groups):
            raise ConfigurationError(f"renderer: geometry groups are 0…5, got {sorted(hidden_groups)}")
        self.model, self.width, self.height = model, width, height
        self._rectangle = mujoco.MjrRect(0, 0, width, height)
        self._scene = mujoco.MjvScene(model, maxgeom=max_geometries)
        self._option = _scene_option(hidden_groups)
        self._raw_rgb = np.empty((height, width, 3), dtype=np.uint8)
        self._raw_depth = np.empty((height, width), dtype=np.float32)
        self._gl = make_gl_context(width, height) if shared_context is None else shared_context
        self._gl.make_current()
        with _quality(model, samples, shadow_size):
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_resizeOffscreen(width, height, self._context)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        if self._context.currentBuffer != mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value:
            self.close()
            raise RenderingError(
                f"this OpenGL ({gl_backend()}) has no framebuffer of {width}×{height} to draw in"
            )
        self._context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR

    def render_rgb(self, data: mujoco.MjData, camera: Camera) -> NDArray[np.uint8]:
        """Colours (H, W, 3) uint8 with shadows; the camera by name or id, or a :class:`mujoco.MjvCamera`."""
        self._update(data, camera)
        return self._draw_colours()

    def render_depth(self, data: mujoco.MjData, camera: Camera) -> NDArray[np.float32]:
        """Depth (H, W) float32, metres along the optical axis; 0 beyond the far plane."""
        self._update(data, camera)
        self._draw_ids(None, self._raw_depth)
        return self._metric_depth()

    def render_segmentation(self, data: mujoco.MjData, camera: Camera) -> NDArray[np.int32]:
        """Geometry ids (H, W) int32; −1 for the background and what is no geometry (skins)."""
        self._update(data, camera)
        self._draw_ids(self._raw_rgb, None)
        return self._geometry_ids()

    def render_rgbd(
        self, data: mujoco.MjData, camera: Camera
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Colours and depth of the same instant, as from :meth:`render_rgb` and :meth:`render_depth`."""
        self._update(data, camera)
        rgb = self._draw_colours()
        self._draw_ids(None, self._raw_depth)
        return rgb, self._metric_depth()

    def render_geometry(
        self, data: mujoco.MjData, camera: Camera
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Depth and geometry ids of the same instant, as from :meth:`render_all`, without the colours."""
        self._update(data, camera)
        self._draw_ids(self._raw_rgb, self._raw_depth)
        return self._metric_depth(), self._geometry_ids()

    def render_all(self, data: mujoco.MjData, camera: Camera) -> CameraView:
        """Colours, depth and geometry ids of the same instant: two passes over the geometry in all."""
        self._update(data, camera)
        rgb = self._draw_colours()
        self._draw_ids(self._raw_rgb, self._raw_depth)
        return CameraView(rgb, self._metric_depth(), self._geometry_ids())

    def close(self) -> None:
        """Free the OpenGL context and what was uploaded to it; may be called twice."""
        context, gl = self._context, self._gl
        self._context = self._gl = None
        if context is not None:
            with gl.as_current():
                context.free()
        if gl is not None and self._owns_gl:
            gl.free()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    def _update(self, data: mujoco.MjData, camera: Camera) -> None:
        if self._context is None:
            raise RenderingError("this renderer is closed; make a new one")
        categories = mujoco.mjtCatBit.mjCAT_STATIC.value | mujoco.mjtCatBit.mjCAT_DYNAMIC.value
        view = camera if isinstance(camera, mujoco.MjvCamera) else _fixed_camera(self.model, camera)
        mujoco.mjv_updateScene(self.model, data, self._option, None, view, categories, self._scene)

    def _draw_colours(self) -> NDArray[np.uint8]:
        self._gl.make_current()
        mujoco.mjr_render(self._rectangle, self._scene, self._context)
        mujoco.mjr_readPixels(self._raw_rgb, None, self._rectangle, self._context)
        return self._raw_rgb[::-1].copy()

    def _draw_ids(self, rgb: NDArray[np.uint8] | None, depth: NDArray[np.float32] | None) -> None:
        """Draw each geometry in the colour of its number, unlit, not antialiased; read what is asked for."""
        self._gl.make_current()
        flags = self._scene.flags
        before = flags.copy()
        flags[[mujoco.mjtRndFlag.mjRND_SEGMENT.value, mujoco.mjtRndFlag.mjRND_IDCOLOR.value]] = 1
        try:
            mujoco.mjr_render(self._rectangle, self._scene, self._context)
        finally:
            flags[:] = before
        mujoco.mjr_readPixels(rgb, depth, self._rectangle, self._context)

    def _metric_depth(self) -> NDArray[np.float32]:
        """Undo the projection: with reversed depth d in [0, 1] (0 far), z = n f / (n + d (f − n))."""
        camera = self._scene.camera[0]
        near, far = np.float32(camera.frustum_near), np.float32(camera.frustum_far)
        raw = self._raw_depth[::-1]
        depth: NDArray[np.float32] = near * far / (near + raw * (far - near))
        depth[raw <= 0] = 0.0
        return depth

    def _geometry_ids(self) -> NDArray[np.int32]:
        geometry_kind = mujoco.mjtObj.mjOBJ_GEOM.value
        table = np.full(self._scene.ngeom + 1, BACKGROUND, dtype=np.int32)
        for geometry in self._scene.geoms[: self._scene.ngeom]:
            if geometry.segid >= 0 and geometry.objtype == geometry_kind:
                table[geometry.segid + 1] = geometry.objid
        codes = self._raw_rgb[::-1].astype(np.int32)
        numbers = codes[:, :, 0] + (codes[:, :, 1] << 8) + (codes[:, :, 2] << 16)
        return np.asarray(table[numbers])


def _scene_option(hidden_groups: Collection[int]) -> mujoco.MjvOption:
    option = mujoco.MjvOption()
    option.geomgroup[:] = [
        group in DEFAULT_VISIBLE_GROUPS and group not in hidden_groups for group in range(6)
    ]
    option.sitegroup[:] = 0  # marks for the modeller, not things
    return option


def _fixed_camera(model: mujoco.MjModel, camera: int | str) -> mujoco.MjvCamera:
    number = model.camera(camera).id if isinstance(camera, str) and _has_camera(model, camera) else camera
    if isinstance(number, str) or not 0 <= number < model.ncam:
        names = [model.camera(i).name for i in range(model.ncam)]
        raise ConfigurationError(f"camera {camera!r}: not in this model; it has {names}")
    view = mujoco.MjvCamera()
    view.type = mujoco.mjtCamera.mjCAMERA_FIXED.value
    view.fixedcamid = number
    return view


def _has_camera(model: mujoco.MjModel, name: str) -> bool:
    return bool(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA.value, name) >= 0)


@contextmanager
def _quality(model: mujoco.MjModel, samples: int | None, shadow_size: int | None) -> Iterator[None]:
    """Set the two qualities that a context takes from the model while it is made, and put them back."""
    quality = model.vis.quality
    before = (quality.offsamples, quality.shadowsize)
    try:
        quality.offsamples = before[0] if samples is None else samples
        quality.shadowsize = before[1] if shadow_size is None else shadow_size
        yield
    finally:
        quality.offsamples, quality.shadowsize = before
