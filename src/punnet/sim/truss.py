"""Trusses: stems as chains of links that bend, with a berry at the end of each branch.

A truss is laid out as plain geometry first (:func:`grow_truss`), so that berries can be kept apart before anything is
built, and then written into the model (:func:`add_truss`). Each link turns about two axes across it; its springs are
preset so that the shape it was grown in is the shape it hangs in.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.sim.layers import PLANT_VISUAL, SOFT_PLANT

__all__ = ["Link", "Truss", "TrussStyle", "add_truss", "grow_truss"]

GRAVITY = 9.81
_STEM_DENSITY = 950.0  # kg/m³, fresh tissue
_BENDING_MODULUS = 200e6  # Pa, green stems; stiffness of a link is E·I / length
_DAMPING_TIME = 0.10  # seconds: damping of a link over its stiffness


@dataclass(frozen=True)
class TrussStyle:
    """Ranges that a truss is grown from; metres and radians."""

    peduncle_length: tuple[float, float] = (0.10, 0.19)
    peduncle_links: int = 4
    pedicel_length: tuple[float, float] = (0.055, 0.12)
    pedicel_links: int = 3
    peduncle_radius: float = 0.0017
    pedicel_radius: float = 0.0011
    spread: float = 0.75


@dataclass(frozen=True, eq=False)
class Link:
    """One rigid piece of stem from ``start`` to ``end``, (3,) in the world; ``parent`` is its index or −1 for the crown."""

    parent: int
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    radius: float


@dataclass(frozen=True, eq=False)
class Truss:
    """Links in order (a parent before its children) and, for each berry, the link it hangs from."""

    links: tuple[Link, ...]
    tips: tuple[int, ...]

    def hanging_point(self, berry: int) -> NDArray[np.float64]:
        """Where berry number ``berry``'s own stem joins the truss, (3,) in the world."""
        return self.links[self.tips[berry]].end


def grow_truss(
    rng: np.random.Generator, anchor: NDArray[np.float64], berries: int, style: TrussStyle
) -> Truss:
    """Lay out a truss that leaves the gutter at ``anchor`` (3,), arches out (towards −x) and droops.

    The first berry hangs at the end of the peduncle, the others on side branches along it.
    """
    outwards = np.array([-1.0, rng.normal(0.0, 0.25), rng.uniform(-1.0, -0.2)])
    links: list[Link] = []
    length = rng.uniform(*style.peduncle_length)
    main = _arch(links, -1, anchor, outwards, length, style.peduncle_links, style.peduncle_radius)
    tips = []
    side = rng.choice((-1.0, 1.0))
    for number in range(berries):
        if number == 0:
            node, heading = main[-1], np.array([0.0, rng.normal(0.0, 0.2), -1.0])
        else:
            node = main[int(rng.integers(1, len(main)))]
            along = links[node].end - links[node].start
            across = np.array([rng.uniform(-0.5, 0.35), side * style.spread * rng.uniform(0.6, 1.4), 0.0])
            heading = along / np.linalg.norm(along) * 0.5 + across
            side = -side
        pedicel = _arch(
            links,
            node,
            links[node].end,
            heading,
            rng.uniform(*style.pedicel_length),
            style.pedicel_links,
            style.pedicel_radius,
        )
        tips.append(pedicel[-1])
    return Truss(tuple(links), tuple(tips))


def _arch(
    links: list[Link],
    parent: int,
    start: NDArray[np.float64],
    heading: NDArray[np.float64],
    length: float,
    count: int,
    radius: float,
) -> list[int]:
    """Append ``count`` links that turn from ``heading`` to straight down; their indices."""
    down = np.array([0.0, 0.0, -1.0])
    heading = heading / np.linalg.norm(heading)
    indices = []
    for step in range(count):
        share = (step + 0.5) / count
        direction = (1.0 - share) ** 1.5 * heading + share * 1.3 * down
        end = start + direction / np.linalg.norm(direction) * (length / count)
        links.append(Link(parent, start, end, radius))
        parent = len(links) - 1
        indices.append(parent)
        start = end
    return indices


def add_truss(
    spec: mujoco.MjSpec,
    name: str,
    truss: Truss,
    loads: tuple[tuple[float, NDArray[np.float64]], ...],
    material: str,
) -> list[str]:
    """Write a truss into ``spec``; the names of the bodies of its links.

    Parameters
    ----------
    loads
        For each berry of the truss (mass in kg, centre of mass (3,) in the world): what the springs must carry.
    """
    carried = _carried_loads(truss, loads)
    bodies: list[mujoco.MjsBody] = []
    for index, link in enumerate(truss.links):
        origin = np.zeros(3) if link.parent < 0 else truss.links[link.parent].start
        parent = spec.worldbody if link.parent < 0 else bodies[link.parent]
        body = parent.add_body(name=f"{name}_link{index}", pos=link.start - origin)
        _add_hinges(body, f"{name}_link{index}", link, carried[index])
        offset = link.end - link.start
        body.add_geom(
            name=f"{name}_stem{index}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=(0.0, 0.0, 0.0, *offset),
            size=(link.radius, 0.0, 0.0),
            density=_STEM_DENSITY,
            contype=SOFT_PLANT[0],
            conaffinity=SOFT_PLANT[1],
            group=PLANT_VISUAL,
            material=material,
            friction=(0.5, 0.01, 0.001),
            solref=(0.008, 1.0),
        )
        bodies.append(body)
    return [body.name for body in bodies]


def _add_hinges(
    body: mujoco.MjsBody, name: str, link: Link, carried: tuple[float, NDArray[np.float64]]
) -> None:
    """Two bending axes; the rest angle of each spring holds what the link carries (moment / stiffness)."""
    direction = link.end - link.start
    length = float(np.linalg.norm(direction))
    direction = direction / length
    first = np.cross(direction, (0.3, 0.9, 0.2))
    first /= np.linalg.norm(first)
    second = np.cross(direction, first)
    stiffness = _BENDING_MODULUS * np.pi * link.radius**4 / 4.0 / length
    mass, centre = carried
    moment = np.cross(centre - link.start, (0.0, 0.0, -mass * GRAVITY))
    for label, axis in (("a", first), ("b", second)):
        rest = float(np.clip(-np.dot(moment, axis) / stiffness, -2.5, 2.5))
        body.add_joint(
            name=f"{name}_{label}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=axis,
            stiffness=stiffness,
            springref=rest,
            damping=stiffness * _DAMPING_TIME,
            armature=6e-6,
        )


def _carried_loads(
    truss: Truss, loads: tuple[tuple[float, NDArray[np.float64]], ...]
) -> list[tuple[float, NDArray[np.float64]]]:
    """Mass and centre of all that hangs from each link, itself included."""
    masses = np.zeros(len(truss.links))
    moments = np.zeros((len(truss.links), 3))
    for index, link in enumerate(truss.links):
        length = float(np.linalg.norm(link.end - link.start))
        masses[index] = _STEM_DENSITY * np.pi * link.radius**2 * length
        moments[index] = masses[index] * (link.start + link.end) / 2.0
    for tip, (mass, centre) in zip(truss.tips, loads, strict=True):
        masses[tip] += mass
        moments[tip] += mass * centre
    for index in range(len(truss.links) - 1, -1, -1):
        parent = truss.links[index].parent
        if parent >= 0:
            masses[parent] += masses[index]
            moments[parent] += moments[index]
    return [(float(m), moment / m) for m, moment in zip(masses, moments, strict=True)]
