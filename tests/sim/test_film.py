import numpy as np
import pytest

from punnet.errors import ConfigurationError
from punnet.sim.cutting import _drop_upper_stub
from punnet.sim.film import FilmStyle, Recorder, render_close_ups, render_film

STYLE = FilmStyle(size=(160, 96), inset=(48, 36), most_frames=5)


def test_states_are_kept_at_the_rate_that_is_asked_for(world):
    recorder = Recorder(rate=20.0)
    for _ in range(500):
        world.step()
        recorder(world)
    assert len(recorder.states) == pytest.approx(20, abs=1)
    times = [state.time for state in recorder.states]
    assert np.allclose(np.diff(times), 0.05, atol=0.003)


def test_a_film_is_drawn_and_leaves_the_world_as_it_was(world, tmp_path):
    recorder = Recorder(rate=10.0)
    for step in range(500):
        world.step()
        recorder.caption = "before" if step < 250 else "after"
        recorder(world)
        if step == 250:
            world.detach(0)
            _drop_upper_stub(world, 0, 0.018)
    shown = world.model.geom_rgba.copy()
    pose = world.data.qpos.copy()
    told = []
    faster = render_film(
        recorder,
        world,
        tmp_path / "film.mp4",
        style=STYLE,
        progress=lambda done, total: told.append((done, total)),
    )
    assert (tmp_path / "film.mp4").read_bytes()[4:8] == b"ftyp"
    assert told[-1][0] == told[-1][1] <= 5
    assert faster == pytest.approx(2 / 10.0 * 15.0)
    assert np.array_equal(world.model.geom_rgba, shown)
    assert np.array_equal(world.data.qpos, pose)


def test_close_ups_show_the_moment_and_only_those_that_came(world):
    recorder = Recorder(rate=50.0, caption="now")
    world.step()
    recorder(world)
    point = world.berry_poses()[0, :3, 3]
    there, never = render_close_ups(recorder, world, [("now", point), ("never", point)])
    assert never is None
    assert there.shape == (320, 320, 3)
    assert there.std() > 10


def test_nothing_recorded_is_an_error(world, tmp_path):
    with pytest.raises(ConfigurationError, match="nothing was recorded"):
        render_film(Recorder(), world, tmp_path / "film.mp4")
    with pytest.raises(ConfigurationError, match="rate"):
        Recorder(rate=0.0)
    assert list(tmp_path.iterdir()) == []
