import json
import re

import numpy as np
import pytest

from punnet.errors import ConfigurationError, FileFormatError
from punnet.robot import HOME, Boxes, MotionGuard, Panda, load_arm
from punnet.robot.arm_shape import arm_spheres, self_clearance, structure_clearance


def written(six_joint_file, tmp_path, **changes):
    """The arm's file beside its model, with fields changed; None leaves one out."""
    data = (
        json.loads(six_joint_file.read_text()) | {"model": str(six_joint_file.with_name("six.xml"))} | changes
    )
    path = tmp_path / "changed.json"
    path.write_text(json.dumps({name: value for name, value in data.items() if value is not None}))
    return path


def test_names_come_along():
    assert isinstance(load_arm("panda"), Panda)
    with pytest.raises(ConfigurationError, match=r"no file 'ur6'.*panda, ur5, xarm7"):
        load_arm("ur6")


@pytest.mark.parametrize("name", ["ur5", "xarm7"])
def test_registered_arms_look_from_where_the_lab_s_does_and_clear_of_themselves(name):
    arm = load_arm(name)
    assert np.abs(arm.forward_kinematics(arm.home) - Panda().forward_kinematics(HOME)).max() < 1e-6
    assert arm.limit_margin(arm.home) > 0.1
    assert self_clearance(arm, arm.home) > 0.0
    assert load_arm(name).home == pytest.approx(arm.home)


def test_what_the_file_says_is_the_arm(six_joints):
    assert six_joints.joint_count == 6
    assert six_joints.limits.joint_names == ("a", "b", "c", "d", "e", "f")
    assert six_joints.limits.velocity == pytest.approx(np.full(6, 2.0))
    assert six_joints.limits.acceleration[3] == 8.0
    assert six_joints.limits.lower[2] == -2.5
    assert six_joints.home == pytest.approx([0.1, -0.4, 1.2, 0.2, 0.6, 0.0])


def test_spheres_hold_the_links_of_the_model(fr3, rng):
    """Corners of the FR3's own collision meshes, carried by the closed form's links, lie inside the spheres."""
    import mujoco

    from punnet.sim.arm import panda_spec

    spec = panda_spec(with_visuals=False)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:7] = q = fr3.home + rng.uniform(-0.2, 0.2, 7)
    mujoco.mj_kinematics(model, data)
    centres, radii = arm_spheres(fr3, q)
    checked = 0
    for geom in range(model.ngeom):
        if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH or model.geom_group[geom] != 3:
            continue
        mesh = model.geom_dataid[geom]
        start = model.mesh_vertadr[mesh]
        corners = model.mesh_vert[start : start + model.mesh_vertnum[mesh]]
        corners = corners @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        inside = np.linalg.norm(corners[:, None] - centres, axis=-1) < radii + 1e-4
        assert inside.any(axis=1).all(), model.geom(geom).name
        checked += len(corners)
    assert checked > 500


def test_the_guard_knows_the_arm_s_own_body(six_joints):
    box = Boxes(np.array([[0.3, -0.2, 0.3]]), np.array([[0.6, 0.2, 0.5]]))
    assert structure_clearance(six_joints, six_joints.home, Boxes.none()) == np.inf
    assert structure_clearance(six_joints, six_joints.home, box) < 0.3
    assert MotionGuard(six_joints).arm.joint_count == 6


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"flange": "tip"}, "no body 'tip'; there are one, two"),
        ({"flange": "three"}, "3 joints; an arm needs at least 6"),
        ({"flange": None}, "field 'flange' is missing"),
        ({"velocity": None}, "field 'velocity' is missing"),
        ({"velocity": "fast"}, "velocity must be numbers"),
        ({"velocity": [1.0, 2.0]}, "velocity must be"),
        ({"velocity": -1.0}, "velocity must be positive"),
        ({"jerk": float("inf")}, "JSON"),
        ({"mount": {"xyz": [0, 0]}}, "mount.xyz must be three numbers"),
        ({"picker": [0, 0, 0]}, "picker must be an object"),
        ({"speed": 1.0}, "unknown field 'speed'"),
        ({"home": [9.0, 0, 0, 0, 0, 0]}, "home .* is outside the joint limits"),
        ({"home": [0.0, 0.0]}, "home_joints must be finite"),
        ({"model": {"file": "a.xml"}}, "model must be a path, or a package"),
        ({"home": None, "mount": {"xyz": [-3.0, 0.0, 0.0]}}, "mount it elsewhere, or give home"),
    ],
)
def test_what_can_not_be_is_named(six_joint_file, tmp_path, changes, words):
    with pytest.raises(FileFormatError, match=words):
        load_arm(written(six_joint_file, tmp_path, **changes))


def test_package_that_is_not_there_is_named(six_joint_file, tmp_path):
    path = written(six_joint_file, tmp_path, model={"package": "no-such-arms", "file": "a.urdf"})
    with pytest.raises(ConfigurationError, match="pip install no-such-arms"):
        load_arm(path)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ('type="sphere" size="0.045"', 'type="ellipsoid" size="0.04 0.03 0.02"', None),
        (
            '<joint name="d" axis="0 0 1" range="-3 3"/>',
            '<joint name="d" type="slide" axis="0 0 1" range="-3 3"/>',
            "'d' does not turn",
        ),
        (
            '<joint name="d" axis="0 0 1" range="-3 3"/>',
            '<joint name="d" axis="0 0 1"/>',
            "'d' has no limits",
        ),
        ("<worldbody>", "<worldbod>", "not readable as URDF or MJCF"),
    ],
)
def test_models_that_are_no_arm_are_refused(six_joint_file, tmp_path, before, after, words):
    model = tmp_path / "six.xml"
    text = six_joint_file.with_name("six.xml").read_text()
    assert before in text
    model.write_text(text.replace(before, after, 1))
    path = written(six_joint_file, tmp_path, model=str(model))
    if words is None:
        assert load_arm(path).joint_count == 6
        return
    with pytest.raises(FileFormatError, match=words):
        load_arm(path)


def test_model_without_anything_to_run_into_is_refused(six_joint_file, tmp_path):
    model = tmp_path / "six.xml"
    text = re.sub(r"<geom [^>]*/>", "", six_joint_file.with_name("six.xml").read_text())
    # MuJoCo wants masses where nothing is drawn.
    model.write_text(
        re.sub(r"(<joint [^>]*/>)", r'\1<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>', text)
    )
    with pytest.raises(FileFormatError, match="none of the links has a collision geometry"):
        load_arm(written(six_joint_file, tmp_path, model=str(model)))
