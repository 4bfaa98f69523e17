"""The bundle ``promp-reach-sim``: a ProMP of simulated reaches, with what it is worth on unseen berries."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.bundle import Manifest, require_bundle_place, write_bundle
from punnet.errors import ConfigurationError, PlanningError
from punnet.movement import ProMP, TrajectoryDistribution
from punnet.planning.promp_depth import ProMPDepthPlanner
from punnet.robot import HOME, JOINT_NAMES, Panda
from punnet.scene import Frame, Target
from punnet.sim.demonstrations import WORKSPACE, Demonstrations, simulate_demonstrations

__all__ = ["BUNDLE_NAME", "build_reach_bundle", "evaluate_leaving_one_out", "fit_reach"]

BUNDLE_NAME = "promp-reach-sim"


def build_reach_bundle(
    folder: str | Path,
    *,
    configurations: int = 25,
    repeats: int = 10,
    seed: int = 0,
    created: str | None = None,
    force: bool = False,
) -> Manifest:
    """Simulate demonstrations, fit, evaluate leaving one configuration out, and write the bundle.

    Parameters
    ----------
    folder
        Where the bundle goes.
    configurations, repeats, seed
        Berry positions, reaches to each, seed of the generator.
    created
        ISO 8601 date for the manifest; now if not given.
    force
        Replace an existing bundle.

    Raises
    ------
    ConfigurationError
        If there are fewer than three configurations, of which one is left out in turn.
    OutputExistsError
        If the folder exists and ``force`` is not set.
    """
    if configurations < 3:
        raise ConfigurationError(f"reach bundle: at least 3 configurations are needed, got {configurations}")
    require_bundle_place(folder, force=force)
    arm = Panda()
    demonstrations = simulate_demonstrations(np.random.default_rng(seed), configurations, repeats, arm=arm)
    promp = fit_reach(demonstrations)
    return write_bundle(
        folder,
        name=BUNDLE_NAME,
        kind="promp",
        licence="Apache-2.0",
        created=created,
        command=f"punnet demos simulate --configs {configurations} --repeats {repeats} --seed {seed} "
        "--bundle DIR",
        seed=seed,
        data={
            "source": "simulated kinematically, thesis section 6.1 (punnet.sim.demonstrations)",
            "configurations": configurations,
            "repeats": repeats,
            "samples": int(demonstrations.joints.shape[1]),
            "start": HOME.tolist(),
            "workspace_m": WORKSPACE.tolist(),
        },
        results={
            "leave_one_configuration_out": evaluate_leaving_one_out(demonstrations, arm),
            "fit_residual_rad": [round(float(value), 6) for value in np.asarray(promp.observation_std)],
        },
        files={"promp.json": promp.to_json()},
        force=force,
    )


def fit_reach(demonstrations: Demonstrations) -> TrajectoryDistribution:
    """Joint-space ProMP of the demonstrations, 8 basis functions."""
    return ProMP().fit(
        list(demonstrations.joints),
        durations=demonstrations.durations.tolist(),
        names=JOINT_NAMES,
    )


def evaluate_leaving_one_out(demonstrations: Demonstrations, arm: Panda) -> dict[str, Any]:
    """Fit without each configuration in turn and measure on it.

    Returns
    -------
    dict
        ``coverage_2_sigma``: share of unseen joint values within two standard deviations (0.954 if Gaussian);
        ``mean_final_error_m``: mean distance from the unconditioned mean's last tool position to the berry;
        ``planned``: share of the berries that the planner reached; ``planned_final_error_m``: their largest
        error; ``planned_path_rms_rad``: root mean square difference from the mean of the unseen reaches.
    """
    phase = np.linspace(0.0, 1.0, demonstrations.joints.shape[1])
    inside, unconditioned, final, path = [], [], [], []
    groups = np.unique(demonstrations.configuration)
    for group in groups:
        unseen = demonstrations.select(demonstrations.configuration == group)
        promp = fit_reach(demonstrations.select(demonstrations.configuration != group))
        mean, std = promp.mean(phase), promp.std(phase)
        inside.append(float((np.abs(unseen.joints - mean) <= 2 * std).mean()))
        unconditioned.append(_tool_error(arm, mean[-1], unseen.targets[0]))
        try:
            planned = ProMPDepthPlanner(promp, arm).plan(_nothing_seen(), _target(unseen.targets[0]), HOME)
        except PlanningError:
            continue
        reach = planned.mean(phase)
        final.append(_tool_error(arm, reach[-1], unseen.targets[0]))
        path.append(float(np.sqrt(np.square(reach - unseen.joints.mean(axis=0)).mean())))
    return {
        "coverage_2_sigma": round(float(np.mean(inside)), 4),
        "mean_final_error_m": round(float(np.mean(unconditioned)), 4),
        "planned": round(len(final) / len(groups), 4),
        "planned_final_error_m": float(f"{max(final):.2g}") if final else None,
        "planned_path_rms_rad": round(float(np.mean(path)), 4) if path else None,
    }


def _tool_error(arm: Panda, joints: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(arm.forward_kinematics_tool(joints)[:3, 3] - target))


def _target(point: NDArray[np.float64]) -> Target:
    return Target(box=np.array([0.0, 0.0, 1.0, 1.0]), picking_point=point)


def _nothing_seen() -> Frame:
    return Frame(rgb=np.zeros((1, 1, 3), dtype=np.uint8))
