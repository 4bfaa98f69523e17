"""``punnet plan``: a reach to one berry of a photograph, with depth or without."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from punnet.cli.console import note, print_json, say
from punnet.cli.eyes import detector_for_photographs
from punnet.cli.options import ArmName, DetectorName, Force, Json, PlannerBundle, RgbFile, SpaceName
from punnet.errors import ConfigurationError, PlanningError

if TYPE_CHECKING:
    from punnet.movement import TrajectoryDistribution
    from punnet.planning import Planner
    from punnet.robot import Arm
    from punnet.scene import Frame, Target

__all__ = ["register"]

PLAN_SPEED = 0.25  # of what the arm can do: nobody has watched this plan before


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(epilog="Example: punnet plan --rgb a.png --target 412,233,470,301 --space task")(plan)


def plan(
    rgb: RgbFile,
    depth: Annotated[
        Path | None,
        typer.Option(
            "--depth",
            help="16-bit PNG aligned to the photograph, millimetres unless the camera file says.",
            show_default=False,
        ),
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option(
            "--camera",
            help="JSON with width height fx fy cx cy; depth_scale and T_base_camera if known.",
            show_default=False,
        ),
    ] = None,
    planner: Annotated[
        str | None,
        typer.Option(
            "--planner",
            help="promp-depth, deep-promp or fused; or a learned planner's bundle or run, used as deep-promp. Without it "
            "fused where there is depth, deep-promp where there is none.",
            show_default=False,
        ),
    ] = None,
    planner_bundle: PlannerBundle = None,
    space: Annotated[
        SpaceName, typer.Option("--space", help="What plan.png and distribution.json are over.")
    ] = SpaceName.JOINT,
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
            "--start",
            help="Joint angles q1,q2,... in radians the arm is at; without it home, or where the demonstrations start "
            "that a learned planner had.",
            show_default=False,
        ),
    ] = None,
    arm: ArmName = "panda",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="Folder for plan.png, plan.csv, trajectory.json, distribution.json. By default PHOTO-reach beside the "
            "photograph; with --json none.",
            show_default=False,
        ),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Plan a reach to one berry: a distribution of trajectories, its picture, and its mean for a robot.

    deep-promp needs the photograph alone. With --depth and --camera the reach ends exactly at the stem; where the camera
    file has no T_base_camera, the camera is taken to sit on the flange at --start.
    """
    import numpy as np

    from punnet.outputs import OutputFolder
    from punnet.planning import DeepProMPPlanner
    from punnet.planning.export import write_plan
    from punnet.planning.targeting import as_seen_from
    from punnet.robot import load_arm
    from punnet.scene import Frame

    if (depth is None) != (camera is None):
        raise ConfigurationError("--depth and --camera belong together: give both or neither")
    box = None if target is None else _numbers(target, 4, "--target")
    body = load_arm(arm)
    chosen = _planner(planner, planner_bundle, has_depth=depth is not None, arm=body)
    usual = chosen.home if isinstance(chosen, DeepProMPPlanner) else body.home
    joints = usual if start is None else np.array(_numbers(start, body.joint_count, "--start"))
    frame = Frame.from_files(rgb, depth=depth, camera=camera)
    if depth is not None:
        frame = as_seen_from(frame, joints, body)
    berry = _target(frame, box, detector)
    distribution = chosen.plan(frame, berry, joints)
    trajectory = distribution.to_joint_trajectory(body.limits, speed=PLAN_SPEED)
    shown = (
        distribution if space is SpaceName.JOINT else _over_poses(chosen, distribution, frame, berry, body)
    )
    if out is None and not as_json:
        out = rgb.with_name(f"{rgb.stem}-reach")
    if out is not None:
        with OutputFolder(out, force=force) as output:
            write_plan(output.path, shown, trajectory)
    point = None if berry.picking_point is None else berry.picking_point
    if as_json:
        print_json(
            {
                "planner": chosen.name,
                "berry": berry.berry_id,
                "box": berry.box.tolist(),
                "picking_point": None if point is None else point.tolist(),
                "space": space.value,
                "out": None if out is None else str(out),
                "trajectory": trajectory.to_json(),
            }
        )
        return
    flange = body.forward_kinematics(trajectory.end)[:3, 3]
    goal, what = (flange, "the flange ends") if point is None else (point, f"berry {berry.berry_id} is")
    place = ", ".join(f"{value:.3f}" for value in goal)
    say(f"{chosen.name}: {what} at ({place}) m in the base frame: {trajectory.duration:.2f} s reach")
    if out is not None:
        say(f"see {out}")


def _planner(name: str | None, bundle: str | None, *, has_depth: bool, arm: Arm) -> Planner:
    """The planner of that name, or of that bundle or run."""
    from punnet.planning.named import DEFAULT_PLANNER, PLANNERS, planner_named

    name = name or (DEFAULT_PLANNER if has_depth else "deep-promp")
    if name != "deep-promp" and name in PLANNERS and not has_depth:
        raise ConfigurationError(f"--planner {name} needs --depth and --camera; deep-promp needs neither")
    if name in PLANNERS:
        return planner_named(name, arm=arm, bundle=bundle)
    return planner_named("deep-promp", arm=arm, bundle=name)


def _target(frame: Frame, box: list[float] | None, detector: str | None) -> Target:
    """The berry that is asked for; where a box is given and depth is not, nobody has to look."""
    import numpy as np

    from punnet.errors import ShapeError
    from punnet.perception.picking_points import locate_picking_points
    from punnet.planning.targeting import choose_target
    from punnet.scene import Target

    if frame.depth is not None:
        berries = locate_picking_points(frame, detector_for_photographs(detector).detect(frame))
        return choose_target(berries, box)
    if box is not None:
        if not (box[0] < box[2] and box[1] < box[3]):
            raise ShapeError(f"--target: a box needs x0 < x1 and y0 < y1, got {box}")
        return Target(box=np.array(box))
    berries = detector_for_photographs(detector).detect(frame)
    if not berries.pluckable.any():
        raise PlanningError(f"{frame.name}: no pluckable berry is seen; give --target x0,y0,x1,y1")
    surest = int(np.argmax(np.where(berries.pluckable, berries.scores, -1.0)))
    note(f"target: berry {berries.ids[surest]}, the surest of {int(berries.pluckable.sum())} pluckable ones")
    return Target(box=berries.boxes[surest], berry_id=int(berries.ids[surest]))


def _over_poses(
    planner: Planner, planned: TrajectoryDistribution, frame: Frame, target: Target, arm: Arm
) -> TrajectoryDistribution:
    """The flange's poses: as the planner predicted them, or where the planned joints bring it."""
    from punnet.movement import ForwardKinematics, to_task_space
    from punnet.planning import DeepProMPPlanner

    if isinstance(planner, DeepProMPPlanner) and planner.space == "task":
        return planner.distribution(frame, target)
    return to_task_space(planned, ForwardKinematics(arm.forward_kinematics, arm.jacobian))


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
