"""``punnet plan``: a reach to one berry of an RGB-D frame."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from punnet.cli.console import print_json, say
from punnet.cli.eyes import detector_for_photographs
from punnet.cli.options import CameraFile, DepthFile, DetectorName, Force, Json, RgbFile
from punnet.errors import ConfigurationError

__all__ = ["register"]

PLAN_SPEED = 0.25  # of what the arm can do: nobody has watched this plan before


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog="Example: punnet plan --rgb rgb.png --depth depth.png --camera camera.json --out reach"
    )(plan)


def plan(
    rgb: RgbFile,
    depth: DepthFile,
    camera: CameraFile,
    detector: DetectorName = None,
    target: Annotated[
        str | None,
        typer.Option(
            "--target", help="x0,y0,x1,y1 pixels around the berry; without it the surest pluckable one."
        ),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            "--start", help="Seven joint angles q1,...,q7 in radians the arm is at; without it home."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Folder for plan.png, plan.csv, trajectory.json, distribution.json."
        ),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Plan a reach to one berry: a distribution of trajectories, its picture, and its mean for a robot.

    Where the camera file has no T_base_camera, the camera is taken to sit on the flange at --start.
    """
    from punnet.outputs import OutputFolder
    from punnet.perception.picking_points import locate_picking_points
    from punnet.planning import ProMPDepthPlanner
    from punnet.planning.export import write_plan
    from punnet.planning.targeting import as_seen_from, choose_target
    from punnet.robot import HOME
    from punnet.scene import Frame

    joints = HOME if start is None else _numbers(start, 7, "--start")
    box = None if target is None else _numbers(target, 4, "--target")
    planner = ProMPDepthPlanner.from_bundle()
    frame = as_seen_from(Frame.from_files(rgb, depth=depth, camera=camera), joints, planner.arm)
    berries = locate_picking_points(frame, detector_for_photographs(detector).detect(frame))
    berry = choose_target(berries, box)
    distribution = planner.plan(frame, berry, joints)
    trajectory = distribution.to_joint_trajectory(planner.arm.limits, speed=PLAN_SPEED)
    if out is not None:
        with OutputFolder(out, force=force) as output:
            write_plan(output.path, distribution, trajectory)
    assert berry.picking_point is not None
    if as_json:
        print_json(
            {
                "berry": berry.berry_id,
                "box": berry.box.tolist(),
                "picking_point": berry.picking_point.tolist(),
                "out": None if out is None else str(out),
                "trajectory": trajectory.to_json(),
            }
        )
        return
    place = ", ".join(f"{value:.3f}" for value in berry.picking_point)
    say(f"berry {berry.berry_id} at ({place}) m in the base frame: {trajectory.duration:.2f} s reach")
    if out is not None:
        say(f"see {out}")


def _numbers(text: str, count: int, option: str) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count:
        raise ConfigurationError(
            f"{option}: {count} numbers with commas between them are needed, got '{text}'"
        )
    return values
