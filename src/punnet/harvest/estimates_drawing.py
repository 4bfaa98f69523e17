"""All weights by eye against what the berries weigh, as one drawing."""

from __future__ import annotations

import math
from collections.abc import Sequence

from punnet.harvest.records import PickRecord
from punnet.harvest.weight_drawing import axis_scale

__all__ = ["draw_estimates", "weighed_twice"]

SIDE, PAD = 320.0, 40.0
BAND = 0.2


def weighed_twice(picks: Sequence[PickRecord]) -> list[tuple[float, float, tuple[float, float] | None]]:
    """Grams by eye, actual grams, and the interval if there is one, of each berry that has both weights."""
    pairs = []
    for pick in picks:
        estimate, actual, interval = pick.estimate_g, pick.actual_g, pick.interval_g
        if estimate is None or actual is None or not (math.isfinite(estimate) and math.isfinite(actual)):
            continue
        known = interval is not None and all(math.isfinite(grams) for grams in interval)
        pairs.append((estimate, actual, interval if known else None))
    return pairs


def draw_estimates(picks: Sequence[PickRecord]) -> str:
    """Give an inline SVG of each estimate, with its interval, over what the berry weighs; "" if none is known.

    On the line is right; in the band is right within 20%.
    """
    pairs = weighed_twice(picks)
    if not pairs:
        return ""
    step, top = axis_scale(max(max(estimate, actual) for estimate, actual, _ in pairs))
    parts = _background(step, top)
    for _, actual, interval in pairs:
        if interval is not None:
            x, (low, high) = _x(actual, top), (_y(grams, top) for grams in interval)
            parts.append(
                f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{low:.1f}" y2="{high:.1f}" '
                'stroke="var(--bar)" stroke-width="5" stroke-linecap="round"/>'
            )
    parts += [
        f'<circle cx="{_x(actual, top):.1f}" cy="{_y(estimate, top):.1f}" r="4.5" fill="var(--red)"/>'
        for estimate, actual, _ in pairs
    ]
    return (
        f'<svg class="estimates" viewBox="0 0 {SIDE:.0f} {SIDE:.0f}" role="img" '
        f'aria-label="Grams by eye over grams that the berry weighs">{"".join(parts)}</svg>'
    )


def _x(grams: float, top: float) -> float:
    return PAD + (SIDE - 2 * PAD) * grams / top


def _y(grams: float, top: float) -> float:
    return SIDE - _x(min(top, max(0.0, grams)), top)


def _background(step: float, top: float) -> list[str]:
    """Band, line of equal weights, axes and their words."""
    left, right, below, above = _x(0, top), _x(top, top), _y(0, top), _y(top, top)
    parts = [
        f'<path d="M{left:.1f} {below:.1f}L{_x(top / (1 + BAND), top):.1f} {above:.1f}H{right:.1f}'
        f'V{_y(top * (1 - BAND), top):.1f}z" fill="var(--well)"/>',
        f'<line x1="{left:.1f}" y1="{below:.1f}" x2="{right:.1f}" y2="{above:.1f}" stroke="var(--soft)"/>',
        f'<path d="M{left:.1f} {above:.1f}V{below:.1f}H{right:.1f}" fill="none" stroke="var(--line)"/>',
        f'<text x="{SIDE / 2:.0f}" y="{SIDE - 6:.0f}" text-anchor="middle">grams it weighs</text>',
        f'<text x="12" y="{SIDE / 2:.0f}" text-anchor="middle" transform="rotate(-90 12 {SIDE / 2:.0f})">'
        "grams by eye</text>",
    ]
    for number in range(round(top / step) + 1):
        grams = number * step
        parts.append(
            f'<text x="{_x(grams, top):.1f}" y="{below + 15:.1f}" text-anchor="middle">{grams:.0f}</text>'
            f'<text x="{left - 6:.1f}" y="{_y(grams, top) + 4:.1f}" text-anchor="end">{grams:.0f}</text>'
        )
    return parts
