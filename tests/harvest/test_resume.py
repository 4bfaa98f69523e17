"""A harvest that is killed, interrupted or out of disk: what is kept, and that it goes on from there."""

import errno
import json
import os
import random
import runpy
import shutil
import time
from pathlib import Path

import numpy as np
import pytest

from punnet.errors import FileFormatError, OutputError, OutputExistsError
from punnet.harvest.folder import LOG_FILE, HarvestFolder, options_of
from punnet.harvest.journal import SessionJournal
from punnet.harvest.scenario import Scenario
from punnet.harvest.session_folder import journaled_session
from punnet.outputs import MARKER_FILE, Interrupted
from punnet.robot import HOME
from punnet.sim.world import WorldConfig

KILLS = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "harvest_kills.py"))
SEED = 1003


def harvest(folder: Path, resume: bool = False, seed: int = SEED):
    world = WorldConfig(KILLS["PLANT"], arm_visuals=False)
    with (
        HarvestFolder(folder, force=True, resume=resume) as output,
        journaled_session(output, Scenario(seed, "oracle", world), {"seed": seed}) as (
            session,
            journal,
            film,
        ),
    ):
        run = session.run()
        picked = sum(fate.success for fate in session.fates())
        journal.note("ended", punnets_g=run.punnet_weights, picked=picked)
        if run.interrupted:
            raise KeyboardInterrupt
        return run, journal, film


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("calm") / "harvest"
    run, _, film = harvest(folder)
    assert len(run.picked) >= 3
    return folder, film


class Killed(BaseException):
    """Stands for a kill: nothing catches it."""


@pytest.fixture(scope="module")
def broken_off(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a harvest that was broken off in its second attempt."""
    folder = tmp_path_factory.mktemp("broken") / "harvest"
    begin = SessionJournal.begin

    def killed(self, attempt):
        begin(self, attempt)
        if attempt.number == 2:
            raise Killed

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SessionJournal, "begin", killed)
        with pytest.raises(Killed):
            harvest(folder)
    return folder


@pytest.fixture
def stopped(broken_off: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(broken_off, tmp_path / "harvest"))


def test_a_harvest_that_goes_on_is_the_one_that_was_not_stopped(calm, stopped: Path) -> None:
    folder, film = calm
    assert options_of(stopped) == {"seed": SEED}
    run, journal, other_film = harvest(stopped, resume=True)
    assert KILLS["outcome"](stopped) == KILLS["outcome"](folder)
    assert journal.history.resumed == [2]
    assert journal.history.lost == 2
    assert [state.time for state in other_film.states] == [state.time for state in film.states]
    assert all(np.array_equal(a.qpos, b.qpos) for a, b in zip(other_film.states, film.states, strict=True))
    assert json.loads((stopped / MARKER_FILE).read_text())["complete"] is True
    assert not (stopped / ".resume").exists()
    assert run.first_frame.timestamp == run.attempts[0].frame.timestamp


def test_a_real_process_killed_in_its_second_pick(calm, tmp_path: Path) -> None:
    killed = tmp_path / "killed"
    process = KILLS["worker"](killed, SEED)
    while len(KILLS["ended"](killed)) < 1:
        assert process.poll() is None
        time.sleep(0.02)
    time.sleep(random.uniform(0.0, 1.0))
    process.kill()
    process.wait()
    assert not KILLS["is_finished"](killed)
    harvest(killed, resume=True)
    assert KILLS["outcome"](killed) == KILLS["outcome"](calm[0])


def test_what_is_finished_is_not_gone_on_with(calm, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="is complete"):
        HarvestFolder(calm[0], resume=True)
    with pytest.raises(OutputError, match=r"holds no harvest\.jsonl"):
        options_of(tmp_path)
    with pytest.raises(OutputExistsError, match="exists"), HarvestFolder(calm[0]):
        pass


def test_an_unfinished_harvest_is_not_begun_anew_by_mistake(stopped: Path) -> None:
    with pytest.raises(OutputExistsError, match="--resume goes on with it"), HarvestFolder(stopped):
        pass
    assert options_of(stopped) == {"seed": SEED}


def interrupted(folder: Path) -> None:
    with HarvestFolder(folder, force=True) as output:
        output.log.append("begun", schema="punnet-harvest-log/1", options={})
        output.keep()
        raise KeyboardInterrupt


def test_a_complete_harvest_stands_until_the_new_one_is_complete(calm, tmp_path: Path) -> None:
    folder = tmp_path / "harvest"
    folder.mkdir()
    (folder / MARKER_FILE).write_text('{"complete": true}')
    (folder / "report.html").write_text("old")
    with pytest.raises(Interrupted) as interrupt:
        interrupted(folder)
    assert interrupt.value.kept == tmp_path / "harvest-partial"
    assert (folder / "report.html").read_text() == "old"
    with HarvestFolder(folder, resume=True):
        pass
    assert (folder / LOG_FILE).is_file()
    assert not (folder / "report.html").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["harvest"]


def test_with_nothing_done_nothing_is_kept(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), HarvestFolder(tmp_path / "harvest"):
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


def test_two_processes_do_not_work_in_one_folder(stopped: Path) -> None:
    with HarvestFolder(stopped, resume=True), pytest.raises(OutputError, match="another process"):
        harvest(stopped, resume=True)


def full_disk(*arguments, **options):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("what", ["punnet.scene.frame._write_png", "os.fsync"])
def test_a_full_disk_ends_the_harvest_with_the_arm_at_home(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    begin = SessionJournal.begin

    def filling(self, attempt):
        begin(self, attempt)
        monkeypatch.setattr(what, full_disk)

    monkeypatch.setattr(SessionJournal, "begin", filling)
    world = WorldConfig(KILLS["PLANT"], arm_visuals=False)
    folder = HarvestFolder(tmp_path / "harvest")
    with folder as output:
        with journaled_session(output, Scenario(SEED, "oracle", world), {}) as (session, _, _):
            run = session.run()
            assert np.abs(session.robot.joints() - HOME).max() < 0.02
        monkeypatch.undo()
    assert "No space left" in run.stopped
    assert run.home
    assert len(run.attempts) == 1
    assert KILLS["ended"](tmp_path / "harvest") == []


def test_a_snapshot_of_another_world_is_refused(stopped: Path) -> None:
    with pytest.raises(FileFormatError, match="another world"):
        harvest(stopped, resume=True, seed=SEED + 1)


def test_a_damaged_snapshot_is_named(stopped: Path) -> None:
    (state,) = (stopped / ".resume").glob("state-*.npz")
    state.write_bytes(state.read_bytes()[:1000])
    with pytest.raises(FileFormatError, match="snapshot: damaged"):
        harvest(stopped, resume=True)


def test_a_berry_that_no_pick_accounts_for_is_weighed_but_not_counted(stopped: Path) -> None:
    world = WorldConfig(KILLS["PLANT"], arm_visuals=False)
    with (
        HarvestFolder(stopped, resume=True) as output,
        journaled_session(output, Scenario(SEED, "oracle", world), {}) as (session, journal, _),
    ):
        reading = journal.history.attempts[0].reading
        session.robot.weigh_punnet = lambda punnet: reading + 17.0 if punnet == 0 else 0.0
        assert session.harvester.reconcile() == pytest.approx([17.0, 0.0])
        assert len(session.harvester.run_so_far.picked) == 1
