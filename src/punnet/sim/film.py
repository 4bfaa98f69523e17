"""Film of a simulated harvest: states are recorded while it runs and drawn afterwards.

Recording costs next to nothing, so filming does not slow a harvest down; and a film can be drawn of the frames that
are worth it, however long the harvest took. Third-person view with the wrist camera's view inset.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, FileFormatError
from punnet.sim.layers import ARM_VISUAL
from punnet.sim.picker import CAMERA_NAME
from punnet.sim.rendering import CameraRenderer
from punnet.sim.video import VideoWriter
from punnet.sim.world import OVERVIEW_CAMERA, World

__all__ = ["FilmStyle", "Recorder", "render_close_ups", "render_film"]

_CAPTION_HEIGHT = 28
_CLOSE_UP_SIZE = (320, 320)


@dataclass(frozen=True, eq=False)
class _State:
    """What it takes to draw one instant; ``cut`` are the geometries that a cut has hidden."""

    time: float
    qpos: NDArray[np.float64]
    cut: NDArray[np.int64]
    caption: str


@dataclass
class Recorder:
    """Observes a world (``robot.observers.append(recorder)``) and keeps its states, ``rate`` a simulated second."""

    rate: float = 10.0
    caption: str = ""
    states: list[_State] = field(default_factory=list)
    _next: float = 0.0

    def __post_init__(self) -> None:
        if self.rate <= 0:
            raise ConfigurationError(f"recorder: rate must be positive, got {self.rate}")

    def __call__(self, world: World) -> None:
        """Keep the state if it is time for one."""
        if world.data.time < self._next:
            return
        self._next = world.data.time + 1.0 / self.rate
        cut = np.flatnonzero(world.model.geom_rgba[:, 3] == 0.0)
        self.states.append(_State(float(world.data.time), world.data.qpos.copy(), cut, self.caption))

    def archive(self, first: int = 0) -> bytes:
        """The states from number ``first`` on, as a NumPy archive that :meth:`add_archive` takes back."""
        states = self.states[first:]
        stream = io.BytesIO()
        np.savez_compressed(
            stream,
            time=np.array([state.time for state in states]),
            qpos=np.array([state.qpos for state in states]),
            caption=np.array([state.caption for state in states], dtype=np.str_),
            cuts=np.array([len(state.cut) for state in states], dtype=np.int64),
            cut=np.concatenate([np.zeros(0, dtype=np.int64), *(state.cut for state in states)]),
        )
        return stream.getvalue()

    def add_archive(self, archive: bytes) -> None:
        """Append the states of an archive.

        Raises
        ------
        FileFormatError
            If it is damaged.
        """
        try:
            with np.load(io.BytesIO(archive), allow_pickle=False) as loaded:
                values = {name: loaded[name] for name in ("time", "qpos", "caption", "cuts", "cut")}
        except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
            raise FileFormatError(f"film: damaged archive of states ({error})") from error
        ends = np.cumsum(values["cuts"])
        cuts = [values["cut"][end - count : end] for end, count in zip(ends, values["cuts"], strict=True)]
        for time, qpos, cut, caption in zip(
            values["time"], values["qpos"], cuts, values["caption"], strict=True
        ):
            self.states.append(_State(float(time), qpos, cut, str(caption)))
        if self.states:
            self._next = self.states[-1].time + 1.0 / self.rate


@dataclass(frozen=True)
class FilmStyle:
    """Size of the picture and of the inset in pixels, frames a second, and the most frames to draw."""

    size: tuple[int, int] = (768, 480)
    inset: tuple[int, int] = (240, 180)
    frames_a_second: float = 15.0
    most_frames: int = 240


def render_film(
    recorder: Recorder,
    world: World,
    path: Path,
    *,
    style: FilmStyle | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> float:
    """Draw what was recorded of ``world`` into an mp4; how many times faster than life it plays.

    The world's state is left as it is; the renderer uses all cores by itself.

    Parameters
    ----------
    recorder
        With the states of ``world``.
    progress
        Told of frames done and frames in all.
    """
    style = style or FilmStyle()
    if not recorder.states:
        raise ConfigurationError("film: nothing was recorded")
    step = max(1, -(-len(recorder.states) // style.most_frames))
    states = recorder.states[::step]
    model = world.model
    at_the_end = model.geom_rgba[:, 3].copy(), model.geom_matid.copy()
    data = mujoco.MjData(model)
    try:
        with ExitStack() as stack:
            overview = stack.enter_context(CameraRenderer(model, *style.size))
            inset = stack.enter_context(CameraRenderer(model, *style.inset, hidden_groups=(ARM_VISUAL,)))
            video = stack.enter_context(VideoWriter(path, fps=style.frames_a_second, size=style.size))
            for done, state in enumerate(states, start=1):
                _set_state(world, data, state)
                picture = overview.render_rgb(data, OVERVIEW_CAMERA).copy()
                _paste(picture, inset.render_rgb(data, CAMERA_NAME))
                _write_caption(picture, f"{state.time:5.1f} s   {state.caption}")
                video.write(picture)
                if progress is not None:
                    progress(done, len(states))
    finally:
        model.geom_rgba[:, 3], model.geom_matid[:] = at_the_end
    return float(step / recorder.rate * style.frames_a_second)


def render_close_ups(
    recorder: Recorder, world: World, moments: Sequence[tuple[str, NDArray[np.float64]]]
) -> list[NDArray[np.uint8] | None]:
    """Pictures (H, W, 3) of what was going on when a caption came up, from nearby; None if it never did.

    Parameters
    ----------
    moments
        Captions, and the points (3,) in the base frame to look at.
    """
    model, data = world.model, mujoco.MjData(world.model)
    at_the_end = model.geom_rgba[:, 3].copy(), model.geom_matid.copy()
    pictures: list[NDArray[np.uint8] | None] = []
    try:
        with CameraRenderer(model, *_CLOSE_UP_SIZE) as renderer:
            for caption, point in moments:
                state = next((state for state in recorder.states if state.caption == caption), None)
                if state is None:
                    pictures.append(None)
                    continue
                _set_state(world, data, state)
                pictures.append(renderer.render_rgb(data, _close_camera(point)).copy())
    finally:
        model.geom_rgba[:, 3], model.geom_matid[:] = at_the_end
    return pictures


def _close_camera(point: NDArray[np.float64]) -> mujoco.MjvCamera:
    """A camera a quarter of a metre away, beside the plant and a little behind it: the arm is not in the way."""
    camera = mujoco.MjvCamera()
    camera.lookat[:] = point - np.array([0.02, 0.0, 0.02])
    camera.distance, camera.azimuth, camera.elevation = 0.25, -112.0, -12.0
    return camera


def _set_state(world: World, data: mujoco.MjData, state: _State) -> None:
    """Bring ``data`` and what is drawn of the stems to a recorded instant."""
    world.hide_stubs(state.cut)
    data.qpos[:] = state.qpos
    mujoco.mj_kinematics(world.model, data)
    mujoco.mj_camlight(world.model, data)


def _paste(picture: NDArray[np.uint8], inset: NDArray[np.uint8]) -> None:
    """The wrist camera's view in the lower left corner, framed."""
    height, width = inset.shape[:2]
    top, left = picture.shape[0] - _CAPTION_HEIGHT - height - 12, 12
    picture[top - 3 : top + height + 3, left - 3 : left + width + 3] = 245
    picture[top : top + height, left : left + width] = inset


def _write_caption(picture: NDArray[np.uint8], text: str) -> None:
    """A line of text on a dark bar at the foot."""
    height = picture.shape[0]
    picture[height - _CAPTION_HEIGHT :] //= 4
    cv2.putText(
        picture, text, (10, height - 9), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (245, 245, 245), 1, cv2.LINE_AA
    )
