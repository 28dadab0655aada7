"""The payload of a simulated KUKA with a force-torque sensor: found from a few poses, and its weight subtracted."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from worlds import write_world

from custom_ros_tools.config import replace_package
from robot_model.geometry import Pose
from robot_model.model import RobotModel
from rpbi.samples import JointStateSample, WrenchSample
from rpbi.world import World
from rpbi_utils.wrenches.calibration import (
    CalibrationParameters,
    MovedError,
    RestingMean,
    WrenchCalibration,
    gravity_in,
)
from rpbi_utils.wrenches.identification import PoseSample, identify_payload

SENSOR = "force_torque_sensor"
CARRIED = {
    SENSOR: 0.0,
    "end_effector": 0.033,
    "end_effector_sponge": 0.033 + 0.087,
    "end_effector_ball": 0.033 + 0.1793,
}
"""Links below the sensor's joint, and how far their frames are along its z axis [m]; they are not turned."""
MASS, CENTRE = 1.5, (0.04, -0.03, 0.08)
"""Mass [kg] and centre of mass [m] of the tool, in its own frame."""
OFFSET = {"bias_force_n": [1.5, -2.5, 4.0], "bias_torque_nm": [0.2, -0.1, 0.3]}
HOME = {"lwr_arm_1_joint": 0.52, "lwr_arm_3_joint": -1.57, "lwr_arm_5_joint": 1.05}
TILTS = (
    {},
    {"lwr_arm_5_joint": 0.3},
    {"lwr_arm_5_joint": 1.6, "lwr_arm_4_joint": 0.8},
    {"lwr_arm_4_joint": -1.2, "lwr_arm_6_joint": 0.7},
)
NEW = (
    {"lwr_arm_5_joint": -0.4, "lwr_arm_4_joint": 0.3},
    {"lwr_arm_1_joint": 0.1, "lwr_arm_5_joint": 1.8},
    {"lwr_arm_4_joint": 1.5, "lwr_arm_6_joint": -1.2},
)
LIMITS = CalibrationParameters(max_samples=100)


class Arm:
    """The arm in its world, and what its sensor reads."""

    def __init__(self, folder: Path) -> None:
        tree = ElementTree.parse(replace_package("{rpbi_examples}/robots/kuka_lwr.urdf"))
        tool = tree.find("link[@name='end_effector']/inertial")
        assert tool is not None
        tool.find("origin").set("xyz", " ".join(map(str, CENTRE)))  # type: ignore[union-attr]
        tool.find("mass").set("value", str(MASS))  # type: ignore[union-attr]
        path = str(folder / "arm.urdf")
        tree.write(path)
        masses, moment = 0.0, np.zeros(3)
        for link, z in CARRIED.items():
            inertial = tree.find(f"link[@name='{link}']/inertial")
            assert inertial is not None
            mass = float(inertial.find("mass").get("value"))  # type: ignore[union-attr,arg-type]
            centre = [float(each) for each in inertial.find("origin").get("xyz").split()]  # type: ignore[union-attr]
            masses, moment = masses + mass, moment + mass * (np.array(centre) + (0.0, 0.0, z))
        self.mass, self.centre = masses, moment / masses
        robot: dict[str, Any] = {
            "name": "arm",
            "loadURDF": {"fileName": path, "useFixedBase": True},
            "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
            "initial_joint_position": HOME,
            "initial_revolute_joint_positions_are_deg": False,
            "joint_state_publisher_hz": 500,
            "enabled_joint_force_torque_sensors": [
                {
                    "joint": "force_torque_sensor_mount",
                    "hz": 500,
                    "noise_force_n": 0.2,
                    "noise_torque_nm": 0.01,
                    **OFFSET,
                }
            ],
        }
        self.world = World.from_file(write_world(folder, robots=(robot,)))
        self._model = RobotModel(path)
        self._wrench, self._pose = np.zeros(6), Pose()

    def go(self, **joints: float) -> None:
        self.world.put("arm/target", {**HOME, **joints})

    def step(self, seconds: float) -> list[tuple[np.ndarray, Pose]]:
        """Returns wrench and pose of the sensor, 500 times a second."""
        read = []
        for _ in range(round(1000 * seconds)):
            samples = {type(each): each for each in self.world.step()}
            if WrenchSample in samples:
                states, wrench = samples[JointStateSample], samples[WrenchSample]
                positions = dict(zip(states.joint_names, states.position))
                pose = self._model.pose([positions[name] for name in self._model.joint_names], SENSOR)
                read.append((np.array(wrench.force + wrench.torque), pose))
        return read

    def rest(self) -> PoseSample:
        """Returns the mean of 100 wrenches in this pose."""
        mean = RestingMean(LIMITS)
        for wrench, pose in self.step(0.2):
            mean.add(wrench, pose)
        wrench, pose = mean.result()
        return PoseSample(wrench, gravity_in(pose, 9.81))


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[Arm]:
    arm = Arm(tmp_path)
    yield arm
    arm.world.close()


@pytest.mark.thorough
def test_identified_payload_has_accurate_mass_and_centre_without_remaining_wrench(arm):
    samples = []
    for tilt in TILTS:
        arm.go(**tilt)
        arm.step(1.5)
        samples.append(arm.rest())
    found = identify_payload(samples, LIMITS)
    assert found.payload.mass == pytest.approx(arm.mass, rel=0.01)
    assert found.payload.centre == pytest.approx(arm.centre, abs=0.002)
    assert found.payload.offset == pytest.approx(OFFSET["bias_force_n"] + OFFSET["bias_torque_nm"], abs=0.15)
    calibration = WrenchCalibration()
    calibration.use(found.payload)
    for tilt in NEW:
        arm.go(**tilt)
        arm.step(1.5)
        one = arm.rest()
        rest = calibration.calibrated(one.wrench, one.gravity)
        assert np.abs(rest[:3]).max() < 0.15 and np.abs(rest[3:]).max() < 0.02
        assert np.abs((one.wrench - samples[0].wrench)[:3]).max() > 3.0, "zeroing in the first pose would not do"


def test_moving_arm_gives_no_sample_and_one_at_rest_does(arm):
    arm.go()
    arm.step(1.0)
    arm.rest()
    arm.go(lwr_arm_5_joint=0.3)
    with pytest.raises(MovedError):
        arm.rest()
    arm.step(1.5)
    arm.rest()
