"""A session of the simulator, from its beginning to its end."""

import gc
import weakref

from punnet.harvest.scenario import ORACLE, Scenario, Session


def test_a_world_is_freed_as_soon_as_its_session_is_left():
    # The collector of cycles does not count the memory of MuJoCo's models, and so comes too late.
    gc.disable()
    try:
        with Session(Scenario(3, ORACLE, suite="easy")) as session:
            world = weakref.ref(session.world)
        del session
        assert world() is None
    finally:
        gc.enable()


def test_who_listens_is_told():
    told = []
    with Session(Scenario(3, ORACLE, suite="easy"), lambda line, attempt: told.append(line)) as session:
        session.harvester.run()
    assert any("sees" in line for line in told)
