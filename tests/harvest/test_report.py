"""The report and its records: one file, all said, nothing from elsewhere."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest

from punnet.errors import ConfigurationError, FileFormatError, OutputError
from punnet.harvest.estimates_drawing import draw_estimates
from punnet.harvest.records import HarvestReport, LeftRecord, PickRecord, PunnetRecord
from punnet.harvest.report import render_report, write_report

VOID = {"meta", "link", "img", "br", "hr", "input"}
MP4 = b"\x00\x00\x00\x18ftypmp42" + bytes(40)


def picture(suffix: str = ".png", shade: int = 90) -> bytes:
    return cv2.imencode(suffix, np.full((12, 16, 3), shade, dtype=np.uint8))[1].tobytes()


@pytest.fixture
def report() -> HarvestReport:
    picks = (
        PickRecord(
            1,
            "pluckable",
            "picked",
            estimate_g=22.0,
            interval_g=(17.0, 27.5),
            weighed_g=20.4,
            true_g=20.0,
            punnet=1,
            seconds_simulated=9.0,
            images={"before": picture(), "at the grip": picture(".jpg")},
            plot=picture(shade=200),
        ),
        PickRecord(2, "pluckable", "failed", "the stem lies <14 mm> below & behind", seconds_simulated=8.0),
        PickRecord(3, "pluckable", "skipped", "out of reach", estimate_g=float("nan")),
    )
    return HarvestReport(
        ripe=4,
        picks=picks,
        left=(
            LeftRecord(8, "unpluckable", "not ripe", picture(".jpg")),
            LeftRecord(9, "pluckable", "hidden by a leaf"),
        ),
        punnets=(PunnetRecord(1, 253.0, 250.0, 13, 248.0, full=True), PunnetRecord(2, 20.4, 250.0, 1, 22.0)),
        seconds_simulated=18.0,
        seconds_computing=7.0,
        settings={"seed": 7, "detector": "colour", "speed": 0.5},
        versions={"punnet": "0.1.0"},
        created="2026-11-22T12:00:00+00:00",
        first_view=picture(".jpg"),
        video=MP4,
    )


class Structure(HTMLParser):
    """Checks that tags close in order, and collects text and what would be loaded."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.sources += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def parse(page: str) -> Structure:
    structure = Structure()
    structure.feed(page)
    structure.close()
    assert structure.open == []
    return structure


def test_page_says_what_happened(report: HarvestReport) -> None:
    text = " ".join(parse(render_report(report)).text.split())
    assert "1 of 4 ripe strawberries picked" in text
    assert "273 g" in text
    assert "18.0 s" in text  # a picked berry, failures included
    assert "10%" in text  # |22 − 20| / 20
    for words in ("the stem lies <14 mm> below & behind", "out of reach", "hidden by a leaf", "not ripe"):
        assert words in text
    assert "22.0 g (17.0 to 27.5)" in text
    assert "seed" in text


def test_page_tells_weights_by_eye_and_in_truth(report: HarvestReport) -> None:
    page = render_report(report)
    text = " ".join(parse(page).text.split())
    assert "Estimated before the pick: 22 g. They weigh 20 g: the estimate was off by +10.0%." in text
    assert "1 of 1 lie in their interval" in text
    assert "248 g by eye before picking · full; giveaway +1.2%" in text
    assert "22 g by eye before picking · not full yet" in text
    assert page.count('class="estimates"') == 1
    unknown = replace(report, picks=report.picks[1:])
    assert "in truth" not in render_report(unknown)


def test_estimates_lie_over_what_the_berries_weigh() -> None:
    """Both axes go to 20 g over 240 units from 40: 16 g by eye of one that weighs 20 g lies at (280, 88)."""
    pick = PickRecord(1, "pluckable", "picked", estimate_g=16.0, interval_g=(10.0, 25.0), true_g=20.0)
    drawing = draw_estimates([pick, replace(pick, estimate_g=None), replace(pick, true_g=None)])
    assert re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', drawing) == [("280.0", "88.0")]
    assert 'x1="280.0" x2="280.0" y1="160.0" y2="40.0"' in drawing
    assert draw_estimates([replace(pick, estimate_g=float("nan"))]) == ""


def test_page_loads_nothing_from_elsewhere(report: HarvestReport) -> None:
    page = render_report(report)
    sources = parse(page).sources
    assert sources
    assert all(source.startswith("data:") for source in sources)
    assert not re.search(r"url\(|@import|<script|https?://", page)


def test_pictures_survive_unchanged(report: HarvestReport) -> None:
    sources = parse(render_report(report)).sources
    decoded = {base64.b64decode(source.split(",", 1)[1]) for source in sources if "base64" in source}
    assert {report.first_view, report.video, report.picks[0].plot} <= decoded
    assert any(source.startswith("data:video/mp4") for source in sources)
    assert any(source.startswith("data:image/jpeg") for source in sources)


def test_nothing_picked_and_nothing_seen() -> None:
    text = " ".join(parse(render_report(HarvestReport(ripe=0, picks=()))).text.split())
    assert "0 of 0 ripe strawberries picked" in text
    assert "a picked berry" not in text


def test_what_was_missed_is_not_called_nothing(report: HarvestReport) -> None:
    seen = replace(report, picks=report.picks[:1], left=())
    assert "did not see 3 ripe berries more" in parse(render_report(seen)).text
    assert "Nothing ripe stayed" in parse(render_report(replace(seen, ripe=1))).text


def test_an_interrupted_run_says_so(report: HarvestReport) -> None:
    assert "interrupted" in parse(render_report(replace(report, interrupted=True))).text
    assert "interrupted" not in parse(render_report(report)).text


def test_a_run_that_went_on_says_where(report: HarvestReport) -> None:
    page = render_report(replace(report, resumed=(2, 3)))
    text = " ".join(parse(page).text.split())
    assert "gone on with 2 times, with attempt 2, 3." in text
    assert page.index("1. pluckable") < page.index("Broken off here") < page.index("2. pluckable")
    assert page.count("Broken off here") == 2
    assert "Broken off" not in render_report(report)


def test_a_run_that_the_robot_stopped_says_why(report: HarvestReport) -> None:
    text = parse(render_report(replace(report, stopped="the arm <does not> get home"))).text
    assert "The robot stopped: the arm <does not> get home." in text


def test_what_was_not_as_usual_is_noted(report: HarvestReport) -> None:
    noted = replace(report.picks[1], notes=("seen from a second view", "then: stop & think"))
    text = parse(render_report(replace(report, picks=(report.picks[0], noted)))).text
    assert "seen from a second view · then: stop & think" in text


def test_unknown_picture_format_is_refused(report: HarvestReport) -> None:
    with pytest.raises(FileFormatError, match="PNG, JPEG or MP4"):
        render_report(replace(report, first_view=b"GIF89a"))


def test_writing(report: HarvestReport, tmp_path: Path) -> None:
    path = write_report(tmp_path / "report.html", report)
    assert path.read_text(encoding="utf-8") == render_report(report)
    with pytest.raises(OutputError, match="can't be written"):
        write_report(tmp_path / "no" / "such" / "folder.html", report)


def test_json_holds_everything_but_the_pictures(report: HarvestReport) -> None:
    data = json.loads(json.dumps(report.to_json(), allow_nan=False))
    assert data["schema"] == "punnet-harvest/1"
    assert (data["picked"], data["ripe"], data["grams"]) == (1, 4, 273.4)
    assert [punnet["full"] for punnet in data["punnets"]] == [True, False]
    assert data["punnets"][0]["giveaway"] == pytest.approx(0.012)
    assert data["punnets"][0]["estimated_g"] == 248.0
    assert data["punnets"][1]["giveaway"] is None
    assert data["seconds_a_pick"] == 18.0
    assert data["mean_relative_weight_error"] == pytest.approx(0.1)
    assert data["picks"][0]["interval_g"] == [17.0, 27.5]
    assert data["picks"][1]["reason"] == report.picks[1].reason
    assert data["picks"][2]["estimate_g"] is None
    assert data["left"][1] == {"id": 9, "class": "pluckable", "reason": "hidden by a leaf"}
    assert data["settings"]["seed"] == 7


def test_a_reason_goes_with_what_was_not_picked() -> None:
    with pytest.raises(ConfigurationError, match="reason"):
        PickRecord(1, "pluckable", "failed")
    with pytest.raises(ConfigurationError, match="reason"):
        PickRecord(1, "pluckable", "picked", "but")
    with pytest.raises(ConfigurationError, match="outcome"):
        PickRecord(1, "pluckable", "lost", "fell")  # type: ignore[arg-type]
