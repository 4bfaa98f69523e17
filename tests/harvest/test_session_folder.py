"""A harvest into a folder: what is told while it runs, and one attempt alone."""

import io
import json
from dataclasses import replace

import cv2
import pytest
from rich.console import Console

from punnet.cli.harvest_progress import dashboard
from punnet.errors import ConfigurationError
from punnet.harvest.folder import HarvestFolder
from punnet.harvest.progress import Progress
from punnet.harvest.scenario import Scenario
from punnet.harvest.session_folder import Announcer, harvest_into
from punnet.sim.cluster import ClusterConfig
from punnet.sim.film import FilmStyle
from punnet.sim.ripeness import RipenessStage
from punnet.sim.world import WorldConfig

PLANT = ClusterConfig(
    trusses=(1, 1),
    berries=(2, 2),
    stage_shares={RipenessStage.RIPE: 1.0},
    canopy_leaves=(0, 0),
    hanging_leaves=(0, 0),
)
SCENARIO = Scenario(3, "oracle", WorldConfig(PLANT, arm_visuals=False))


@pytest.fixture(autouse=True)
def short_films(monkeypatch: pytest.MonkeyPatch) -> None:
    style = FilmStyle(size=(192, 128), inset=(48, 36), most_frames=12)
    monkeypatch.setattr("punnet.sim.film.FilmStyle", lambda: style)


def test_one_attempt_alone(tmp_path) -> None:
    told: list[Progress] = []
    with HarvestFolder(tmp_path / "second") as output:
        report = harvest_into(output, SCENARIO, Announcer(progress=told.append), pick=2)
    assert [pick.id for pick in report.picks] == [2]
    assert report.only == 2
    assert "Attempt 2: <b>picked</b>" in (tmp_path / "second" / "report.html").read_text()
    film = cv2.VideoCapture(str(tmp_path / "second" / "harvest.mp4"))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == pytest.approx(12, abs=1)
    log = [json.loads(line) for line in (tmp_path / "second" / "harvest.jsonl").read_text().splitlines()]
    assert [record["number"] for record in log if record["kind"] == "attempt_ended"] == [1, 2]
    assert [progress.picked for progress in told] == sorted(progress.picked for progress in told)
    last = told[-1]
    assert (last.picked, last.not_picked) == (2, 0)
    assert last.grams == pytest.approx(sum(record.get("weighed_g", 0.0) for record in log))
    assert told[0].pluckable == 2
    assert last.pluckable == 0


def test_an_attempt_that_was_not_made_is_named(tmp_path) -> None:
    one = replace(SCENARIO, world=WorldConfig(replace(PLANT, berries=(1, 1)), arm_visuals=False))
    with (
        HarvestFolder(tmp_path / "x") as output,
        pytest.raises(ConfigurationError, match="has only 1 attempts"),
    ):
        harvest_into(output, one, pick=5)


def test_the_dashboard_shows_it_all() -> None:
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(dashboard(Progress(9, 4, 3, 1, (125.0, 40.0), 61.3), 250.0, "berry 4: cuts the stem"))
    text = console.export_text()
    for words in (
        "9 berries, 4 pluckable",
        "3, 165 g",
        "set aside",
        "125 of 250 g",
        "█" * 10 + "░" * 10,
        "61 s",
        "cuts",
    ):
        assert words in text
