"""Film of a simulated harvest: states are recorded while it runs and drawn afterwards, on several cores.

Recording costs next to nothing, so filming does not slow a harvest down. A worker builds the same world again from
its seed and draws the states that it is given: third-person view with the wrist camera's view inset.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import mujoco
import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.sim.layers import ARM_VISUAL
from punnet.sim.picker import CAMERA_NAME
from punnet.sim.rendering import CameraRenderer
from punnet.sim.video import VideoWriter
from punnet.sim.world import OVERVIEW_CAMERA, World, WorldConfig, build_world

__all__ = ["FilmStyle", "Recorder", "render_film"]

_BATCH = 12  # frames a worker draws before it hands them over
_CAPTION_HEIGHT = 28


@dataclass(frozen=True, eq=False)
class _State:
    """What it takes to draw one instant."""

    time: float
    qpos: NDArray[np.float64]
    hidden: NDArray[np.int64]
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
        hidden = np.flatnonzero(world.model.geom_rgba[:, 3] == 0.0)
        self.states.append(_State(float(world.data.time), world.data.qpos.copy(), hidden, self.caption))


@dataclass(frozen=True)
class FilmStyle:
    """Size of the picture and of the inset in pixels, frames a second, and the most frames to draw."""

    size: tuple[int, int] = (768, 480)
    inset: tuple[int, int] = (240, 180)
    frames_a_second: float = 15.0
    most_frames: int = 240


def render_film(
    recorder: Recorder,
    seed: int,
    config: WorldConfig,
    path: Path,
    *,
    style: FilmStyle | None = None,
    workers: int = 2,
    progress: Callable[[int, int], None] | None = None,
) -> float:
    """Draw what was recorded into an mp4; how many times faster than life it plays.

    Parameters
    ----------
    recorder
        With the states of a world built from ``seed`` and ``config``.
    progress
        Told of frames done and frames in all.
    """
    style = style or FilmStyle()
    if not recorder.states:
        raise ConfigurationError("film: nothing was recorded")
    step = max(1, -(-len(recorder.states) // style.most_frames))
    states = recorder.states[::step]
    batches = [states[start : start + _BATCH] for start in range(0, len(states), _BATCH)]
    drawn = Parallel(n_jobs=workers, return_as="generator", batch_size=1, pre_dispatch="2*n_jobs")(
        delayed(_draw_batch)(seed, config, style, batch) for batch in batches
    )
    done = 0
    with VideoWriter(path, fps=style.frames_a_second, size=style.size) as video:
        for frame in _decoded(drawn):
            video.write(frame)
            done += 1
            if progress is not None:
                progress(done, len(states))
    return float(step / recorder.rate * style.frames_a_second)


def _decoded(batches: Iterator[list[bytes]]) -> Iterator[NDArray[np.uint8]]:
    for batch in batches:
        for encoded in batch:
            image = cv2.imdecode(np.frombuffer(encoded, dtype=np.uint8), cv2.IMREAD_COLOR)
            yield np.ascontiguousarray(np.asarray(image, dtype=np.uint8)[:, :, ::-1])


class _Studio:
    """One world with its two renderers, kept by a worker from batch to batch."""

    def __init__(self, seed: int, config: WorldConfig, style: FilmStyle) -> None:
        self.key = (seed, repr(config), style)
        self.world = build_world(seed, config)
        self.rgba = self.world.model.geom_rgba.copy()
        self.materials = self.world.model.geom_matid.copy()
        self.overview = CameraRenderer(self.world.model, *style.size)
        self.inset = CameraRenderer(self.world.model, *style.inset, hidden_groups=(ARM_VISUAL,))

    def draw(self, state: _State, style: FilmStyle) -> NDArray[np.uint8]:
        model, data = self.world.model, self.world.data
        model.geom_rgba[:] = self.rgba
        model.geom_matid[:] = self.materials
        model.geom_rgba[state.hidden, 3] = 0.0
        model.geom_matid[state.hidden] = -1
        data.qpos[:] = state.qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        picture = self.overview.render_rgb(data, OVERVIEW_CAMERA).copy()
        _paste(picture, self.inset.render_rgb(data, CAMERA_NAME))
        _write_caption(picture, f"{state.time:5.1f} s   {state.caption}")
        return picture

    def close(self) -> None:
        self.overview.close()
        self.inset.close()


_studio: _Studio | None = None


def _draw_batch(seed: int, config: WorldConfig, style: FilmStyle, states: list[_State]) -> list[bytes]:
    """Pictures of ``states`` as JPEG; the world and its renderers stay for the next batch of the same film."""
    global _studio
    if _studio is None or _studio.key != (seed, repr(config), style):
        if _studio is not None:
            _studio.close()
        _studio = _Studio(seed, config, style)
    encoded = []
    for state in states:
        picture = _studio.draw(state, style)
        _, buffer = cv2.imencode(".jpg", picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])
        encoded.append(buffer.tobytes())
    return encoded


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
