"""The report of a harvest: one HTML file that needs nothing else, to read on a phone, to print, to send."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Mapping
from html import escape
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

from punnet.errors import FileFormatError, OutputError
from punnet.harvest.estimates_drawing import draw_estimates, weighed_twice
from punnet.harvest.records import HarvestReport, LeftRecord, PickRecord, PunnetRecord
from punnet.harvest.weight_drawing import draw_weights

__all__ = ["render_report", "write_report"]

TEMPLATE = "report_template.html"
SIGNATURES = (
    (b"\x89PNG\r\n\x1a\n", 0, "image/png"),
    (b"\xff\xd8\xff", 0, "image/jpeg"),
    (b"ftyp", 4, "video/mp4"),
)
BADGES = {"picked": "✓ picked", "failed": "✕ failed", "skipped": "– skipped"}


def write_report(path: str | Path, report: HarvestReport) -> Path:
    """Write :func:`render_report` to a file.

    Raises
    ------
    OutputError
        If it can't be written.
    FileFormatError
        If a picture is neither PNG nor JPEG, or the video no MP4.
    """
    path = Path(path)
    page = render_report(report)
    try:
        path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path}: the report can't be written ({error.strerror})") from error
    return path


def render_report(report: HarvestReport) -> str:
    """Give the page as text; pictures and the video are part of it."""
    template = Template(resources.files("punnet.harvest").joinpath(TEMPLATE).read_text(encoding="utf-8"))
    return template.substitute(
        title=escape(report.title),
        created=escape(report.created),
        headline=_headline(report),
        stopped=_stopped(report),
        tiles="".join(
            f"<li><strong>{value}</strong><span>{label}</span></li>" for value, label in _tiles(report)
        ),
        views=_views(report),
        picks=_section("Berry by berry", f'<div class="cards">{_cards(report)}</div>', report.picks),
        weights=_weights(report),
        punnets=_section(
            "In the punnets", f'<div class="punnets">{_join(_punnet, report.punnets)}</div>', report.punnets
        ),
        left=_not_picked(report),
        settings=_settings(report.settings, report.versions),
    )


def _headline(report: HarvestReport) -> str:
    if report.only is not None:
        return f"Attempt {report.only}: <b>{report.picks[0].outcome if report.picks else 'not made'}</b>"
    berries = "strawberry" if report.ripe == 1 else "strawberries"
    return f"<b>{len(report.picked)} of {report.ripe}</b> ripe {berries} picked"


def _stopped(report: HarvestReport) -> str:
    words = []
    if report.interrupted:
        words.append("The harvest was interrupted; this is what was done until then.")
    if report.stopped is not None:
        words.append(f"The robot stopped: {escape(report.stopped)}.")
    if report.resumed:
        times = "once" if len(report.resumed) == 1 else f"{len(report.resumed)} times"
        words.append(
            f"The harvest was broken off and gone on with {times}, with attempt {_listed(report.resumed)}."
        )
    return f'<p class="stopped">{" ".join(words)}</p>' if words else ""


def _listed(numbers: Iterable[int]) -> str:
    return ", ".join(str(number) for number in numbers)


def _cards(report: HarvestReport) -> str:
    """A card an attempt, and a mark where the harvest went on after it had been broken off."""
    mark = '<p class="resumed">Broken off here, and gone on with.</p>'
    return "".join((mark if pick.id in report.resumed else "") + _card(pick) for pick in report.picks)


def _tiles(report: HarvestReport) -> Iterable[tuple[str, str]]:
    yield f"{report.grams:.0f} g", "in the punnets"
    if report.seconds_a_pick is not None:
        yield f"{report.seconds_a_pick:.1f} s", "a picked berry, on the robot's clock"
    yield f"{report.seconds_simulated:.0f} s", "of picking"
    yield f"{report.seconds_computing:.0f} s", "to compute it"
    if report.weight_error is not None:
        yield f"{100 * report.weight_error:.0f}%", "mean error of the weights by eye"


def _views(report: HarvestReport) -> str:
    views = ""
    if report.first_view is not None:
        picture = _image(report.first_view, "The plant at the first look, with the berries that were found")
        views += (
            f'<figure class="panel">{picture}<figcaption>First look: what was found.</figcaption></figure>'
        )
    if report.video is not None:
        views += (
            f'<figure class="panel has-video"><video controls muted playsinline preload="metadata" '
            f'src="{_data_uri(report.video)}"></video><figcaption>The harvest.</figcaption></figure>'
        )
    return f'<div class="views">{views}</div>' if views else ""


def _card(pick: PickRecord) -> str:
    reason = ""
    if pick.reason is not None:
        reason = f'<p class="reason {pick.outcome}">{escape(pick.reason)}</p>'
    notes = f'<p class="soft notes">{escape(" · ".join(pick.notes))}</p>' if pick.notes else ""
    crops = "".join(
        f"<figure>{_image(data, caption)}<figcaption>{escape(caption)}</figcaption></figure>"
        for caption, data in pick.images.items()
    )
    plot = ""
    if pick.plot is not None:
        picture = _image(pick.plot, "Joint angles of the planned reach with their spread")
        words = "Planned reach: mean, ±σ and ±2σ of each joint; via-points in red."
        plot = f'<figure class="plot"><div>{picture}</div><figcaption>{words}</figcaption></figure>'
    return (
        f'<article class="card"><header><h3>{pick.id}. {escape(pick.berry_class)}</h3>'
        f'<span class="badge {pick.outcome}">{BADGES[pick.outcome]}</span>'
        f'<span class="time number">{pick.seconds_simulated:.1f} s</span></header>{reason}{notes}'
        f'<div class="crops">{crops}</div>'
        f'<div class="body{" with-plot" if plot else ""}">{draw_weights(pick)}{plot}</div></article>'
    )


def _weights(report: HarvestReport) -> str:
    """All estimates against what the berries weigh, and how far their sum is off."""
    pairs = weighed_twice(report.picked)
    if not pairs:
        return ""
    by_eye, weigh = sum(estimate for estimate, _, _ in pairs), sum(actual for _, actual, _ in pairs)
    bounds = [(interval, actual) for _, actual, interval in pairs if interval is not None]
    inside = sum(low <= actual <= high for (low, high), actual in bounds)
    words = (
        f"<p>Estimated before the pick: <b>{by_eye:.0f} g</b>. They weigh <b>{weigh:.0f} g</b>: "
        f"the estimate was off by {_signed(by_eye / weigh - 1)}. {inside} of {len(bounds)} lie in their interval.</p>"
        '<p class="soft">A dot on the line is right, in the band right within 20%; bars are the intervals.</p>'
    )
    drawing = draw_estimates(report.picked)
    return _section("By eye and in truth", f'<div class="by-eye">{drawing}<div>{words}</div></div>', pairs)


def _signed(share: float) -> str:
    return f"{share:+.1%}".replace("-", "−")


def _punnet(punnet: PunnetRecord) -> str:
    share = 100 * min(1.0, punnet.grams / punnet.nominal_g) if punnet.nominal_g > 0 else 0.0
    berries = "1 berry" if punnet.berries == 1 else f"{punnet.berries} berries"
    words = [f"{punnet.estimated_g:.0f} g by eye before picking"] if punnet.estimated_g else []
    if punnet.giveaway is not None:
        words.append(f"full; giveaway {_signed(punnet.giveaway)}")
    else:
        words.append("not full yet" if punnet.berries else "empty")
    return (
        f'<article class="card"><h3>Punnet {punnet.number}</h3>'
        f'<div class="fill" role="img" aria-label="{share:.0f}% full">'
        f'<i style="width:{share:.1f}%"></i></div><span class="number">{punnet.grams:.0f} g</span> '
        f'<span class="soft">of {punnet.nominal_g:.0f} g · {berries}<br>{" · ".join(words)}</span>'
        "</article>"
    )


def _not_picked(report: HarvestReport) -> str:
    tried = [pick for pick in report.picks if pick.outcome != "picked"]
    rows = [
        (
            f"attempt {pick.id}",
            pick.berry_class,
            "tried" if pick.outcome == "failed" else "no plan",
            str(pick.reason),
        )
        for pick in tried
    ]
    left = _as_left(report.left)
    rows += [(f"berry {b.id}", b.berry_class, "left", b.reason) for b in left if b.image is None]
    pictures = "".join(_seen_last(berry.image, berry) for berry in left if berry.image is not None)
    if not rows and not pictures:
        missed = report.ripe - len(report.picked)
        berries = "1 ripe berry" if missed == 1 else f"{missed} ripe berries"
        text = (
            f"The last look did not see {berries} more."
            if missed > 0
            else "Nothing ripe stayed on the plant."
        )
        return _section("Not picked", f"<p>{text}</p>", [text])
    table = _table(("", "class", "what was done", "why"), rows) if rows else ""
    if pictures:
        table += f'<p class="soft">Left on the plant, as the last look showed them:</p><div class="crops">{pictures}</div>'
    return _section("Not picked, and why", table, table)


def _seen_last(picture: bytes, berry: LeftRecord) -> str:
    shown = _image(picture, f"{berry.berry_class} berry as it was seen last")
    return (
        f"<figure>{shown}<figcaption><b>{escape(berry.berry_class)}</b>: {escape(berry.reason)}"
        "</figcaption></figure>"
    )


def _as_left(left: Iterable[LeftRecord]) -> list[LeftRecord]:
    """Ripe berries first: they are what a reader looks for."""
    return sorted(left, key=lambda berry: (berry.berry_class, berry.id))


def _settings(settings: Mapping[str, Any], versions: Mapping[str, str]) -> str:
    rows = [
        (name, value if isinstance(value, str) else json.dumps(value)) for name, value in settings.items()
    ]
    rows += [(name, version) for name, version in versions.items()]
    return _section("To make it again", _table(("setting", "value"), rows), rows)


def _table(columns: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    head = "".join(f"<th>{escape(column)}</th>" for column in columns)
    body = "".join(
        f"<tr><th>{escape(row[0])}</th>" + "".join(f"<td>{escape(cell)}</td>" for cell in row[1:]) + "</tr>"
        for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def _section(title: str, content: str, items: Any) -> str:
    return f"<section><h2>{escape(title)}</h2>{content}</section>" if len(items) else ""


def _join(render: Any, items: Iterable[Any]) -> str:
    return "".join(render(item) for item in items)


def _image(data: bytes, description: str) -> str:
    return f'<img src="{_data_uri(data)}" alt="{escape(description)}">'


def _data_uri(data: bytes) -> str:
    for signature, offset, kind in SIGNATURES:
        if data[offset : offset + len(signature)] == signature:
            return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
    raise FileFormatError(f"report: PNG, JPEG or MP4 is needed, got bytes that begin with {data[:8]!r}")
