"""A berry's outline along its axis, completed where something hides it, and how far its front bulges over that.

The axis runs from the top key-point to the bottom one; without them, along the longest extent of the outline. All
is measured on the plane across the line of sight through the berry, in metres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.scene import KEYPOINTS
from punnet.weight.cloud import solve_normal
from punnet.weight.observation import BerryObservation

__all__ = ["STATIONS", "SURFACE_TERMS", "BerryProfile", "BerryRelief", "measure_profile", "measure_relief"]

STATIONS = 9
"""Places along the axis at which the width is taken: the middles of as many equal parts."""
SURFACE_TERMS = (
    *((0, 0), (1, 0), (2, 0), (3, 0), (0, 1), (1, 1), (2, 1)),
    *((0, 2), (1, 2), (2, 2), (0, 3), (1, 3), (0, 4), (1, 4)),
)
"""Orders (along, across) of the polynomials that a cloud is described by; the first, a constant, is not told."""

_PICKING_POINT, _TOP, _BOTTOM = (KEYPOINTS.index(name) for name in ("picking_point", "top", "bottom"))
_GRASPS = [KEYPOINTS.index("left_grasp"), KEYPOINTS.index("right_grasp")]
_GRASP_INSET = 0.92
"""Grasp points lie this far on the way from the axis to the outline."""
_SHORTEST_AXIS = 0.003
_NARROWEST = 1e-4
_SURFACE_STATIONS = 33


@dataclass(frozen=True, eq=False)
class BerryProfile:
    """The outline in the berry's own coordinates: along the axis from the top, and across it; metres.

    Parameters
    ----------
    origin
        (2,) where the top is on the plane.
    axis
        (2,) unit vector from top to bottom.
    seen
        (K, 2) hull of what shows, (along, across).
    completed
        (M, 2) hull of that and of the key-points, hidden ones among them.
    keypoint_length, keypoint_width
        Top to bottom, and from side to side as the grasp points tell; NaN without them.
    stem_length, stem_bend
        From the picking point to the top, and the angle in radians from there on to the bottom; NaN without them. The
        picking point lies a fixed length above the fruit, so a short stem leans towards the camera or away.
    """

    origin: NDArray[np.float64]
    axis: NDArray[np.float64]
    seen: NDArray[np.float64]
    completed: NDArray[np.float64]
    keypoint_length: float
    keypoint_width: float
    stem_length: float
    stem_bend: float

    @cached_property
    def begin(self) -> float:
        """Where the completed outline begins along the axis."""
        return float(self.completed[:, 0].min())

    @cached_property
    def length(self) -> float:
        """Of the completed outline along the axis."""
        return float(np.ptp(self.completed[:, 0]))

    @cached_property
    def width(self) -> float:
        """Of the completed outline across the axis."""
        return float(np.ptp(self.completed[:, 1]))

    def in_axis_frame(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(P, 2) of the plane, metres, to (along, across)."""
        across = np.array((-self.axis[1], self.axis[0]))
        return np.asarray((points - self.origin) @ np.column_stack((self.axis, across)))


def measure_profile(berry: BerryObservation) -> BerryProfile:
    """The outline of a berry along its axis."""
    outline, scale = berry.outline, berry.scale
    known: NDArray[np.bool_] = np.asarray(np.isfinite(berry.crop_keypoints).all(axis=1))
    keypoints = np.full((len(KEYPOINTS), 2), np.nan)
    keypoints[known] = outline.on_plane(berry.crop_camera, berry.crop_keypoints[known]) * scale
    span = keypoints[_BOTTOM] - keypoints[_TOP]
    length = float(np.linalg.norm(span))
    has_axis = length > _SHORTEST_AXIS  # False for NaN
    if has_axis:
        origin, axis = keypoints[_TOP], span / length
    else:
        axis = np.linalg.eigh(outline.spread)[1][:, -1]
        axis = axis if axis[1] >= 0 else -axis
        along = outline.corners @ axis
        origin = (outline.centre + axis * (float(along.min()) - outline.centre @ axis)) * scale
    frame = BerryProfile(origin, axis, np.empty((0, 2)), np.empty((0, 2)), *(math.nan,) * 4)
    seen = frame.in_axis_frame(outline.corners * scale)
    points, width = [seen], math.nan
    if has_axis:
        points.append(frame.in_axis_frame(keypoints[[_TOP, _BOTTOM]]))
    if known[_GRASPS].all():
        grasps = frame.in_axis_frame(keypoints[_GRASPS])
        middle = 0.0 if has_axis else grasps[:, 1].mean()
        grasps[:, 1] = middle + (grasps[:, 1] - middle) / _GRASP_INSET
        width = float(np.linalg.norm(grasps[1] - grasps[0]))
        points.append(grasps)
    whole = cv2.convexHull(np.vstack(points).astype(np.float32))[:, 0].astype(np.float64)
    stem = frame.in_axis_frame(keypoints[_PICKING_POINT][None])[0] if has_axis else np.full(2, np.nan)
    return BerryProfile(
        origin,
        axis,
        seen,
        whole,
        keypoint_length=length if has_axis else math.nan,
        keypoint_width=width,
        stem_length=float(np.hypot(*stem)),
        stem_bend=float(np.arctan2(stem[1], -stem[0])),
    )


def chords(
    polygon: NDArray[np.float64], stations: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where a convex polygon (K, 2) of (along, across) begins and ends across the axis at stations (S,); 0 outside."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    run = b[:, 0] - a[:, 0]
    share = (stations - a[:, :1]) / np.where(run == 0.0, 1.0, run)[:, None]
    crossing = (share >= 0.0) & (share <= 1.0) & (run != 0.0)[:, None]
    across = a[:, 1:] + share * (b[:, 1] - a[:, 1])[:, None]
    met = crossing.any(axis=0)
    low = np.where(met, np.where(crossing, across, np.inf).min(axis=0), 0.0)
    high = np.where(met, np.where(crossing, across, -np.inf).max(axis=0), 0.0)
    return low, high


@dataclass(frozen=True)
class BerryRelief:
    """How the front of a berry bulges over its completed outline.

    Parameters
    ----------
    aspect
        Half extent towards the camera over half width, of a body whose every cross-section is an ellipse.
    curved_aspect
        The same with the axis free to bend towards the camera.
    noise
        Standard error of ``aspect`` by the depth's noise at that distance.
    believed
        Logarithm of ``aspect``, as far as it tells of the volume and is not noise.
    distance
        Metres along the line of sight to the body's middle, its front bulging as believed.
    tilt
        Metres that the axis goes away from the camera for each metre along it.
    residual
        Metres, of the fit.
    across, along
        Curvature of the surface across and along the axis, times the width and the length.
    covered_from, covered_to
        Part of the axis, 0 the top, 1 the bottom, along which there are points.
    surface
        Depth over width as Legendre polynomials :data:`SURFACE_TERMS` of the place along (−1 top … 1 bottom) and across
        (−1 … 1 from side to side of the completed outline), smoothed.
    """

    aspect: float
    curved_aspect: float
    noise: float
    believed: float
    distance: float
    tilt: float
    residual: float
    across: float
    along: float
    covered_from: float
    covered_to: float
    surface: tuple[float, ...]


_DISPARITY_NOISE = 0.08 / (385.0 * 0.050)
"""Relative standard deviation of depth for each metre of it, of the D435i (see the simulator's depth sensor)."""
_PIXELS_A_PATCH = 400.0
"""Stereo errs alike over patches of about a hundred pixels, and the plane that is fitted along takes some of the bulge:
calibrated on 1,600 simulated berries, each with and without noise."""
_ASPECT_SPREAD, _ASPECT_GAIN = 0.15, 0.45
"""Spread of ln aspect over berries that are seen without noise, and how much of it is in their volume; the rest are
lobes of the front that the back need not have (3,500 berries of the simulator, random views)."""
_STIFFNESS = 1e-4
_ASPECT_LIMITS = (0.5, 2.0)


def measure_relief(berry: BerryObservation, profile: BerryProfile) -> BerryRelief:
    """Fit the front of a body with elliptic cross-sections, tilted and sheared at will, to the cloud.

    Depth = a + b·along + c·across − aspect · √(h² − (across − m)²) with h(along) half the width of the outline and
    m(along) its middle. A plane that is added to an ellipsoid leaves an ellipsoid of the same outline and volume, so
    tilt towards the camera needs no model of its own.
    """
    turned = berry.cloud @ berry.outline.R_view_camera.T
    along, across = profile.in_axis_frame(turned[:, :2]).T
    depth = turned[:, 2] - turned[:, 2].mean()
    begin, length, width = profile.begin, profile.length, profile.width
    grid = begin + length * np.linspace(0.0, 1.0, _SURFACE_STATIONS)
    low, high = chords(profile.completed, grid)
    middle = np.interp(along, grid, (low + high) / 2.0)
    half = np.maximum(np.interp(along, grid, (high - low) / 2.0), _NARROWEST)
    dome = np.sqrt(np.clip(half**2 - (across - middle) ** 2, 0.0, None))
    x, y = (across - across.mean()) / width, (along - along.mean()) / length
    # All fits share columns, and so their normal equations: ones, along, across, −dome / width, and the squares.
    columns = np.stack((np.ones_like(x), y, x, dome / -width, y * y, x * x, x * y))
    normal, projected = columns @ columns.T, columns @ depth

    def fitted(*chosen: int) -> NDArray[np.float64]:
        return solve_normal(normal[np.ix_(chosen, chosen)], projected[list(chosen)], len(depth))

    straight, bent, paraboloid = fitted(0, 1, 2, 3), fitted(0, 1, 2, 3, 4), fitted(0, 1, 2, 5, 4, 6)
    residual = float(np.sqrt(np.mean((depth - straight @ columns[:4]) ** 2)))
    patches = max(1.0, len(depth) / _PIXELS_A_PATCH)
    deviation = _DISPARITY_NOISE * float(turned[:, 2].mean()) ** 2 / math.sqrt(patches)
    noise = deviation / max(float(dome.std()), 1e-4)
    aspect = float(straight[3]) / width
    believed = _believed(aspect, noise)
    # With the bulge held at what is believed, the plane through the middle follows.
    lifted = projected[:3] - math.exp(believed) * width * normal[:3, 3]
    plane = solve_normal(normal[:3, :3], lifted, len(depth))
    centre = np.array((begin + length / 2.0, 0.0)) - (along.mean(), across.mean())
    middle_depth = plane[0] + plane[1] * centre[0] / length + plane[2] * centre[1] / width
    reach = np.clip((np.array((along.min(), along.max())) - begin) / length, 0.0, 1.0)
    return BerryRelief(
        aspect=aspect,
        curved_aspect=float(bent[3]) / width,
        noise=noise,
        believed=believed,
        distance=float(turned[:, 2].mean() + middle_depth),
        tilt=float(straight[1]) / length,
        residual=residual,
        across=float(paraboloid[3]) / width,
        along=float(paraboloid[4]) / length,
        covered_from=float(reach[0]),
        covered_to=float(reach[1]),
        surface=_surface(2.0 * (along - begin) / length - 1.0, (across - middle) / half, depth / width),
    )


def _surface(
    along: NDArray[np.float64], across: NDArray[np.float64], depth: NDArray[np.float64]
) -> tuple[float, ...]:
    orders = np.array(SURFACE_TERMS)
    lengthwise, crosswise = _legendre(along, 3), _legendre(np.clip(across, -1.0, 1.0), 4)
    columns = lengthwise[orders[:, 0]] * crosswise[orders[:, 1]]
    normal = columns @ columns.T
    # The higher the order, the more it takes to bend the surface where points are few or noisy.
    normal[np.diag_indices_from(normal)] += len(depth) * (1e-6 + _STIFFNESS * orders.max(axis=1) ** 2)
    solution = np.linalg.solve(normal, columns @ (depth - depth.mean()))
    return tuple(solution[1:].tolist())


def _legendre(places: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
    """Legendre polynomials of orders 0 … degree at places (P,), (degree + 1, P)."""
    values = np.ones((degree + 1, len(places)))
    values[1] = places
    for order in range(2, degree + 1):
        values[order] = (
            (2 * order - 1) * places * values[order - 1] - (order - 1) * values[order - 2]
        ) / order
    return values


def _believed(aspect: float, noise: float) -> float:
    """Ln aspect, as far as it tells of the volume and is not noise."""
    low, high = _ASPECT_LIMITS
    share = _ASPECT_GAIN * _ASPECT_SPREAD**2 / (_ASPECT_SPREAD**2 + noise**2)
    return share * math.log(min(max(aspect, low), high))
