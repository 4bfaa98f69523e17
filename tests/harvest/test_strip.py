"""The strip of pictures of a pick."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from punnet.harvest.scenario import Scenario, Session
from punnet.harvest.strip import SIZE, strip
from punnet.robot import Panda
from punnet.sim.world import WorldConfig


@pytest.fixture(scope="module")
def attempt():
    with Session(Scenario(6, "oracle", WorldConfig(arm_visuals=False))) as session:
        session.robot.grip = lambda: (_ for _ in ()).throw(KeyboardInterrupt)
        return session.run().attempts[0]


def decoded(picture: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1].astype(int)


def test_pictures_in_the_order_of_the_pick(attempt) -> None:
    blue = np.full((320, 320, 3), (0, 0, 255), dtype=np.uint8)
    pictures = strip(attempt, {"at the cut": blue}, Panda())
    assert list(pictures) == ["before", "planned: mean and samples", "at the cut"]
    assert {decoded(picture).shape for picture in pictures.values()} == {(SIZE, SIZE, 3)}
    assert np.abs(decoded(pictures["at the cut"]) - (0, 0, 255)).max() < 8


def test_the_planned_reach_ends_at_the_berry(attempt) -> None:
    """The mean's end is ringed in white, where the picking point is seen."""
    with_reach = decoded(strip(attempt, {}, Panda())["planned: mean and samples"])
    box = attempt.berry.boxes[0]
    scale = SIZE / round(2 * (0.5 + 1.7) * np.max(box[2:] - box[:2]))
    u, v = (attempt.berry.keypoints[0, 0] - (box[:2] + box[2:]) / 2.0) * scale + SIZE / 2
    around = with_reach[round(v) - 6 : round(v) + 7, round(u) - 6 : round(u) + 7]
    assert around.min(axis=2).max() > 225


def test_without_a_plan_there_is_only_the_berry(attempt) -> None:
    assert list(strip(replace(attempt, distribution=None), {}, Panda())) == ["before"]
