"""Physical features of one berry, by group: what tells its weight beyond size in pixels.

Lengths and volumes are metric, ratios have no unit; every number is finite whatever is missing.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from punnet.perception.picking_points import PICKING_HEIGHT
from punnet.scene import KEYPOINTS, Visibility
from punnet.weight.completion import complete_outline
from punnet.weight.ellipsoid import EllipsoidEstimator
from punnet.weight.observation import BerryObservation
from punnet.weight.profile import (
    STATIONS,
    SURFACE_TERMS,
    BerryProfile,
    BerryRelief,
    chords,
    measure_profile,
    measure_relief,
)

__all__ = ["SHAPE_FEATURES", "shape_features"]

_MILLILITRES = 1e6
_ELLIPSOID = EllipsoidEstimator()
_SEEN_FROM = ("top", "bottom", "left_grasp", "right_grasp")
_Chords = tuple[NDArray[np.float64], NDArray[np.float64]]


def _surface_name(along: int, across: int) -> str:
    return f"surface_{along}_{across}"


SHAPE_FEATURES: dict[str, dict[str, str]] = {
    "metric": {
        "length_m": "along the key-point axis, of the outline completed by the key-points",
        "width_m": "across that axis, likewise",
        "seen_length_m": "along the axis, of the outline of what shows",
        "seen_width_m": "across the axis, of the outline of what shows",
        "keypoint_length_m": "from top to bottom; length_m without key-points",
        "keypoint_width_m": "from side to side as the grasp points tell; width_m without key-points",
        "visible_area_m2": "of the mask",
        "outline_area_m2": "of the completed outline",
        "revolution_ml": "volume of the completed outline turned about its axis, chord by chord",
        "seen_revolution_ml": "the same of the outline of what shows",
        "mirrored_ml": "the same with each half chord as long as the longer: the better half stands for both",
        "relief_ml": "revolution_ml with the aspect and distance that the cloud tells, as far as noise lets them count",
        "distance_m": "from the camera to the berry's middle",
        "distance_change": "by which the bulge corrects the distance, over it",
        "pixels_log": "logarithm of the mask's pixels",
        "points_log": "logarithm of the cloud's points",
    },
    "profile": {
        **{
            f"width_{k}": f"width at part {k + 1} of {STATIONS} of the axis, over width_m"
            for k in range(STATIONS)
        },
        "elongation": "length_m over width_m",
        "fullness": "outline_area_m2 over length_m times width_m",
        "roundness": "revolution_ml over outline_area_m2 to the power 3/2",
        "asymmetry": "mean offset of the chords' middles from the axis, over width_m",
        "mirrored_share": "mirrored_ml over revolution_ml",
    },
    "relief": {
        "aspect": "half extent towards the camera over half width, from the cloud's bulge",
        "curved_aspect": "the same with an axis that may bend",
        "believed_aspect": "logarithm of aspect, shrunk by the depth's noise at that distance",
        "aspect_noise": "standard error of aspect by that noise",
        "tilt": "metres away from the camera for each metre along the axis",
        "residual_m": "of the fit of the bulge",
        "curvature_across": "of the cloud across the axis, times width",
        "curvature_along": "of the cloud along the axis, times length",
        "dome": "bulge over the outline's ellipse of equal moments, over width_m",
        **{
            _surface_name(
                along, across
            ): f"depth over width_m, Legendre orders {along} along and {across} across"
            for along, across in SURFACE_TERMS[1:]
        },
    },
    "occlusion": {
        "hidden": "share of the outline at which something nearer begins",
        "cut": "share of the mask's box that lies on the image's border",
        "outline_seen": "area of the outline of what shows over that of the completed outline",
        "solidity": "visible_area_m2 over the area of its outline",
        "revolution_seen": "seen_revolution_ml over revolution_ml",
        "length_seen": "seen_length_m over keypoint_length_m",
        "width_seen": "seen_width_m over keypoint_width_m",
        "no_reading": "share of the mask without depth",
        "edge": "share of the mask at its edge",
        "covered_from": "part of the axis, from the top, at which points begin",
        "covered_to": "part of the axis at which they end",
        **{f"{name}_hidden": f"1 if something else hides {name}" for name in _SEEN_FROM},
        **{f"{name}_behind": f"1 if the fruit itself hides {name}" for name in _SEEN_FROM},
        "without_axis": "1 if top or bottom is not known",
    },
    "completion": {
        "completed_length_m": "length of the tapered ellipse that the berry's own edges make likeliest",
        "completed_width_m": "its width",
        "completed_ml": "volume of its body of revolution",
        "completed_uncertainty": "standard deviation of the logarithm of that volume, as the edges leave it open",
        "completed_length_uncertainty": "of the logarithm of the length",
        "completed_misfit": "by which the edges are off it, over half its width",
        "completed_taper": "by how much it is narrower towards the bottom",
        "completed_turn_rad": "from the key-point axis to its own",
        "completed_begin": "where it begins along the axis, over its length",
        "completed_end": "where it ends, over keypoint_length_m",
        "own_edge": "share of the outline that is the berry's own edge",
        "completed_over_revolution": "completed_ml over revolution_ml",
        "completed_over_keypoint_length": "completed_length_m over keypoint_length_m",
        "completed_over_keypoint_width": "completed_width_m over keypoint_width_m",
    },
    "detection": {
        "score": "how sure the detector is; 1 of an annotated berry",
        "annotated": "1 if the score is 1: hidden key-points are then known, which a detector guesses",
    },
    "stem": {
        "stem_length_m": "from the picking point to the top; as long as it is in space without key-points",
        "stem_bend_rad": "angle between stem and axis; 0 without key-points",
    },
    "ripeness": {"ripeness": "0 green … 1 red all over; 1 if unknown, as what is weighed is ripe as a rule"},
    "ellipsoid": {
        "ellipsoid_g": "grams of the ellipsoid estimator",
        "revolution_over_ellipsoid": "revolution_ml over ellipsoid_g",
        "relief_over_ellipsoid": "relief_ml over ellipsoid_g",
    },
}
"""What each feature is, by group; the unit is the end of its name, none if it has none."""


def shape_features(berry: BerryObservation) -> dict[str, float]:
    """All of :data:`SHAPE_FEATURES` of one berry, by name."""
    profile = measure_profile(berry)
    relief = measure_relief(berry, profile)
    widths = chords(profile.completed, _stations(profile))
    metric = _metric(berry, profile, relief, widths)
    grams = _ELLIPSOID.weigh(berry)[0]
    return {
        **metric,
        **_profile(profile, metric, widths),
        **_relief(berry, profile, relief),
        **_occlusion(berry, profile, relief, metric),
        **_completion(berry, profile, metric),
        "score": berry.score,
        "annotated": float(berry.score >= 1.0),
        "stem_length_m": _or(profile.stem_length, PICKING_HEIGHT),
        "stem_bend_rad": _or(profile.stem_bend, 0.0),
        "ripeness": 1.0 if math.isnan(berry.ripeness) else berry.ripeness,
        "ellipsoid_g": grams,
        "revolution_over_ellipsoid": metric["revolution_ml"] / grams,
        "relief_over_ellipsoid": metric["relief_ml"] / grams,
    }


def _metric(
    berry: BerryObservation, profile: BerryProfile, relief: BerryRelief, widths: _Chords
) -> dict[str, float]:
    low, high = widths
    seen_low, seen_high = chords(profile.seen, _stations(profile))
    longer = np.maximum(np.abs(low), np.abs(high))
    turned = math.pi * profile.length * _MILLILITRES
    revolution = turned * float(np.mean((high - low) ** 2)) / 4.0
    pixels = int(np.count_nonzero(berry.mask))
    return {
        "length_m": profile.length,
        "width_m": profile.width,
        "seen_length_m": float(np.ptp(profile.seen[:, 0])),
        "seen_width_m": float(np.ptp(profile.seen[:, 1])),
        "keypoint_length_m": _or(profile.keypoint_length, profile.length),
        "keypoint_width_m": _or(profile.keypoint_width, profile.width),
        "visible_area_m2": pixels * berry.pixel_area,
        "outline_area_m2": _area(profile.completed),
        "revolution_ml": revolution,
        "seen_revolution_ml": turned * float(np.mean((seen_high - seen_low) ** 2)) / 4.0,
        "mirrored_ml": turned * float(np.mean(longer**2)),
        "relief_ml": revolution * math.exp(relief.believed) * (relief.distance / berry.scale) ** 3,
        "distance_m": berry.distance,
        "distance_change": relief.distance / berry.scale - 1.0,
        "pixels_log": math.log(pixels),
        "points_log": math.log(len(berry.cloud)),
    }


def _profile(profile: BerryProfile, metric: dict[str, float], widths: _Chords) -> dict[str, float]:
    low, high = widths
    return {
        **{f"width_{k}": float(width) / profile.width for k, width in enumerate(high - low)},
        "elongation": profile.length / profile.width,
        "fullness": metric["outline_area_m2"] / (profile.length * profile.width),
        "roundness": metric["revolution_ml"] / _MILLILITRES / metric["outline_area_m2"] ** 1.5,
        "asymmetry": float(np.mean(np.abs(high + low))) / 2.0 / profile.width,
        "mirrored_share": metric["mirrored_ml"] / metric["revolution_ml"],
    }


def _relief(berry: BerryObservation, profile: BerryProfile, relief: BerryRelief) -> dict[str, float]:
    dome = berry.relief / profile.width
    return {
        "aspect": relief.aspect,
        "curved_aspect": relief.curved_aspect,
        "believed_aspect": relief.believed,
        "aspect_noise": relief.noise,
        "tilt": relief.tilt,
        "residual_m": relief.residual,
        "curvature_across": relief.across,
        "curvature_along": relief.along,
        "dome": _or(dome, 0.45 * relief.aspect),
        **{
            _surface_name(*orders): value
            for orders, value in zip(SURFACE_TERMS[1:], relief.surface, strict=True)
        },
    }


def _occlusion(
    berry: BerryObservation, profile: BerryProfile, relief: BerryRelief, metric: dict[str, float]
) -> dict[str, float]:
    pixels = int(berry.mask.sum())
    seen_area = _area(profile.seen)
    codes = [int(berry.visibility[KEYPOINTS.index(name)]) for name in _SEEN_FROM]
    return {
        "hidden": berry.hidden,
        "cut": _cut(berry),
        "outline_seen": seen_area / metric["outline_area_m2"],
        "solidity": metric["visible_area_m2"] / seen_area,
        "revolution_seen": metric["seen_revolution_ml"] / metric["revolution_ml"],
        "length_seen": metric["seen_length_m"] / metric["keypoint_length_m"],
        "width_seen": metric["seen_width_m"] / metric["keypoint_width_m"],
        "no_reading": berry.dropped.get("no reading", 0) / pixels,
        "edge": berry.dropped.get("edge", 0) / pixels,
        "covered_from": relief.covered_from,
        "covered_to": relief.covered_to,
        **{
            f"{name}_hidden": float(code == Visibility.HIDDEN_BY_OTHER)
            for name, code in zip(_SEEN_FROM, codes, strict=True)
        },
        **{
            f"{name}_behind": float(code == Visibility.HIDDEN_BY_ITSELF)
            for name, code in zip(_SEEN_FROM, codes, strict=True)
        },
        "without_axis": float(math.isnan(profile.keypoint_length)),
    }


def _completion(berry: BerryObservation, profile: BerryProfile, metric: dict[str, float]) -> dict[str, float]:
    points = np.empty((0, 2))
    if len(berry.contour):
        pixels = berry.contour - (berry.window[1].start, berry.window[0].start)
        points = profile.in_axis_frame(berry.outline.on_plane(berry.crop_camera, pixels) * berry.scale)
    whole = complete_outline(points, berry.covered, profile.completed)
    millilitres = whole.volume * _MILLILITRES
    return {
        "completed_length_m": whole.length,
        "completed_width_m": whole.width,
        "completed_ml": millilitres,
        "completed_uncertainty": whole.uncertainty,
        "completed_length_uncertainty": whole.length_uncertainty,
        "completed_misfit": whole.misfit,
        "completed_taper": whole.taper,
        "completed_turn_rad": whole.turn,
        "completed_begin": whole.begin / whole.length,
        "completed_end": (whole.begin + whole.length) / metric["keypoint_length_m"],
        "own_edge": whole.own,
        "completed_over_revolution": millilitres / metric["revolution_ml"],
        "completed_over_keypoint_length": whole.length / metric["keypoint_length_m"],
        "completed_over_keypoint_width": whole.width / metric["keypoint_width_m"],
    }


def _stations(profile: BerryProfile) -> NDArray[np.float64]:
    return profile.begin + profile.length * (np.arange(STATIONS) + 0.5) / STATIONS


def _cut(berry: BerryObservation) -> float:
    """Share of the rows and columns of the mask's box that reach the image's border."""
    rows, columns = berry.window
    touched = 0
    if rows.start == 0:
        touched += int(berry.mask[0].sum())
    if rows.stop == berry.camera.height:
        touched += int(berry.mask[-1].sum())
    if columns.start == 0:
        touched += int(berry.mask[:, 0].sum())
    if columns.stop == berry.camera.width:
        touched += int(berry.mask[:, -1].sum())
    return touched / sum(berry.mask.shape)


def _area(polygon: NDArray[np.float64]) -> float:
    x, y = polygon.T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2.0


def _or(value: float, fallback: float) -> float:
    return fallback if math.isnan(value) else value
