"""The weights of one berry as a small drawing: estimate with interval, weigh cell, truth, on one scale."""

from __future__ import annotations

import math

from punnet.harvest.records import PickRecord

__all__ = ["axis_scale", "draw_weights"]

WIDTH, LEFT, RIGHT, AXIS, MIDDLE = 300.0, 4.0, 292.0, 38.0, 20.0
NICE_STEPS = (5.0, 10.0, 20.0, 25.0, 50.0, 100.0)


def draw_weights(pick: PickRecord) -> str:
    """Give HTML: an inline SVG and the figures in words, or a sentence if no weight is known."""
    estimate, weighed, truth = (_known(grams) for grams in (pick.estimate_g, pick.weighed_g, pick.true_g))
    known = [grams for grams in (estimate, weighed, truth) if grams is not None]
    if not known:
        return '<div class="weight soft">No weight: depth told nothing of this berry.</div>'
    interval = [max(0.0, grams) for grams in pick.interval_g or () if math.isfinite(grams)]
    highest = max(*known, *interval, 0.0)
    step, top = axis_scale(highest)

    def place(grams: float) -> float:
        return LEFT + (RIGHT - LEFT) * grams / top

    marks = [_axis(step, top)]
    words = []
    if estimate is not None:
        spread = ""
        if len(interval) == 2:
            spread = f" ({interval[0]:.1f} to {interval[1]:.1f})"
            low, high = (place(grams) for grams in interval)
            marks.append(
                f'<rect x="{low:.1f}" y="{MIDDLE - 6}" width="{high - low:.1f}" height="12" rx="6" '
                'fill="var(--bar)"/>'
            )
        words.append(_word("estimate", _dot(5, 5), f"{estimate:.1f} g{spread}"))
        marks.append(_dot(place(estimate), MIDDLE))
    if weighed is not None:
        words.append(_word("weigh cell", _tick(5, 5), f"{weighed:.1f} g"))
        marks.append(_tick(place(weighed), MIDDLE))
    if truth is not None:
        words.append(_word("truth", _diamond(5, 5), f"{truth:.1f} g"))
        marks.append(_diamond(place(truth), MIDDLE))
    drawing = (
        f'<svg viewBox="0 0 {WIDTH:.0f} 54" role="img" aria-label="Weights in grams">{"".join(marks)}</svg>'
    )
    return f'<div class="weight">{drawing}<dl>{"".join(words)}</dl></div>'


def axis_scale(highest: float) -> tuple[float, float]:
    """Step and end of an axis from 0 that holds ``highest`` grams."""
    step = next((size for size in NICE_STEPS if highest / size <= 5), NICE_STEPS[-1])
    return step, float(step * max(1, math.ceil(highest / step)))


def _known(grams: float | None) -> float | None:
    return None if grams is None or not math.isfinite(grams) else float(grams)


def _axis(step: float, top: float) -> str:
    parts = [f'<line x1="{LEFT}" x2="{RIGHT}" y1="{AXIS}" y2="{AXIS}" stroke="var(--line)"/>']
    for number in range(round(top / step) + 1):
        x = LEFT + (RIGHT - LEFT) * number * step / top
        unit = " g" if number * step == top else ""
        anchor = "start" if number == 0 else "end" if unit else "middle"
        parts.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{AXIS}" y2="{AXIS + 4}" stroke="var(--soft)"/>')
        parts.append(
            f'<text x="{x:.1f}" y="{AXIS + 15}" text-anchor="{anchor}">{number * step:.0f}{unit}</text>'
        )
    return "".join(parts)


def _word(label: str, mark: str, value: str) -> str:
    return f'<dt><svg viewBox="0 0 10 10" aria-hidden="true">{mark}</svg>{label}</dt><dd>{value}</dd>'


def _dot(x: float, y: float) -> str:
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4.5" fill="var(--red)"/>'


def _tick(x: float, y: float) -> str:
    return f'<rect x="{x - 1.25:.1f}" y="{y - 10:.1f}" width="2.5" height="20" fill="var(--ink)"/>'


def _diamond(x: float, y: float) -> str:
    shape = f"M{x:.1f} {y - 5:.1f}l5 5l-5 5l-5-5z"
    return f'<path d="{shape}" fill="var(--card)" stroke="var(--green)" stroke-width="2"/>'
