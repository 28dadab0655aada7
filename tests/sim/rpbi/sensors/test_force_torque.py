"""Force-torque sensors against Newton and Euler, and what they make of noise, filters and zeroing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from newton_euler import ARM, DAMPING, MOVING, urdf, wrenches
from worlds import write_world

from custom_ros_tools.errors import ConfigError, PhysicsError
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.control.joint_command import JointCommand
from rpbi.samples import JointStateSample, WrenchSample
from rpbi.world import World

JOINTS = [f"{link.name}_joint" for link in ARM]
MOVING_JOINTS = [JOINTS[index] for index in MOVING]
DT_S = 0.001


def make_world(folder, mode="POSITION_CONTROL", sensors=None, main=None, description=None, fixed=True, **robot):
    (folder / "arm.urdf").write_text(description or urdf())
    config = {
        "name": "arm",
        "loadURDF": {"fileName": str(folder / "arm.urdf"), "useFixedBase": fixed},
        "setJointMotorControlArray": {"controlMode": mode},
        "joint_state_publisher_hz": 1000,
        "enabled_joint_force_torque_sensors": JOINTS if sensors is None else sensors,
        "target_timeout_s": 100.0,
        **robot,
    }
    return World.from_file(write_world(folder, robots=(config,), **(main or {})))


@pytest.fixture
def world_of(tmp_path):
    worlds = []

    def make(**options):
        worlds.append(make_world(tmp_path, **options))
        return worlds[-1]

    yield make
    for world in worlds:
        world.close()


def step(world, ticks=1):
    """Steps and returns the last wrench of each joint as six numbers."""
    latest = {}
    for _ in range(ticks):
        for sample in world.step():
            if isinstance(sample, WrenchSample):
                latest[sample.name.split("/")[1]] = np.array([*sample.force, *sample.torque])
    return latest


def joint_state(world):
    arm = world.bodies["arm"]
    states = [world.pb.getJointState(arm.body_id, arm.model[JOINTS[index]].index) for index in MOVING]
    return ({index: state[part] for index, state in zip(MOVING, states)} for part in (0, 1))


def put(world, q, dq):
    arm = world.bodies["arm"]
    for index in MOVING:
        world.pb.resetJointState(arm.body_id, arm.model[JOINTS[index]].index, q[index], dq[index])


def along_axis(index, wrench):
    """Returns what of a joint's wrench its motor has to bring up: force or moment along the axis."""
    return float(np.dot(wrench[1 if ARM[index].joint_type == "revolute" else 0], ARM[index].axis))


def assert_within_one_percent(found, expected, what=""):
    for part, name in ((slice(0, 3), "force"), (slice(3, 6), "moment")):
        size = np.linalg.norm(expected[part])
        allowed = 0.01 * np.abs(expected[part]) + 0.002 * size
        off = np.abs(found[part] - expected[part])
        assert np.all(off <= allowed), f"{what} {name}: {found[part]}, expected {expected[part]}"


@pytest.mark.parametrize("feedback_mode", [None, 0, 1, 2, 3])
def test_joints_at_rest_read_newton_euler_wrenches_in_20_poses(world_of, feedback_mode):
    main = {} if feedback_mode is None else {"setPhysicsEngineParameter": {"jointFeedbackMode": feedback_mode}}
    world = world_of(main=main)
    random = np.random.default_rng(1)
    still = dict.fromkeys(MOVING, 0.0)
    for _ in range(20 if feedback_mode is None else 2):
        q = {index: random.uniform(-1.5, 1.5) if index != 1 else random.uniform(-0.3, 0.3) for index in MOVING}
        put(world, q, still)
        world.put("arm/target", JointCommand(MOVING_JOINTS, [q[index] for index in MOVING]))
        found = step(world, 300)
        standing, _ = joint_state(world)
        for joint, (force, moment) in zip(JOINTS, wrenches(standing, still, still), strict=True):
            assert_within_one_percent(found[joint], np.concatenate([force, moment]), joint)


@pytest.mark.parametrize("mode", ["POSITION_CONTROL", "VELOCITY_CONTROL", "TORQUE_CONTROL", "IMPEDANCE_CONTROL"])
def test_moving_joints_read_newton_euler_wrenches_in_20_states(world_of, mode):
    world = world_of(mode=mode, target_interpolation="hold")
    random = np.random.default_rng(2)
    still = dict.fromkeys(MOVING, 0.0)
    for _ in range(20):
        q = {index: random.uniform(-1.5, 1.5) if index != 1 else random.uniform(-0.3, 0.3) for index in MOVING}
        dq = {index: random.uniform(-1.5, 1.5) for index in MOVING}
        put(world, q, dq)
        goals = [q[index] + 0.01 * dq[index] for index in MOVING]
        efforts = [along_axis(index, wrenches(q, still, still)[index]) + random.uniform(-1.0, 1.0) for index in MOVING]
        velocities = [1.1 * dq[index] for index in MOVING]
        world.put("arm/target", JointCommand(MOVING_JOINTS, goals, velocities, efforts))
        step(world, 20)
        q_old, dq_old = joint_state(world)
        found = step(world)
        q_new, dq_new = joint_state(world)
        halfway = {index: (q_old[index] + q_new[index]) / 2 for index in MOVING}
        mean = {index: (dq_old[index] + dq_new[index]) / 2 for index in MOVING}
        change = {index: (dq_new[index] - dq_old[index]) / DT_S for index in MOVING}
        for joint, (force, moment) in zip(JOINTS, wrenches(halfway, mean, change), strict=True):
            assert_within_one_percent(found[joint], np.concatenate([force, moment]), f"{mode} {joint}")


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_effort_of_the_motor_is_in_the_reading_once(world_of, sign):
    """PyBullet's own reading lacks it under position and velocity control."""
    world = world_of(mode="TORQUE_CONTROL", main={"setGravity": {"gravZ": 0.0}})
    put(world, dict.fromkeys(MOVING, 0.0), dict.fromkeys(MOVING, 0.0))
    efforts = [sign * 2.0, sign * -3.0, sign * 0.5]
    world.put("arm/target", JointCommand(MOVING_JOINTS, (), (), efforts))
    found = step(world, 2)
    for index, effort in zip(MOVING, efforts, strict=True):
        wrench = found[JOINTS[index]]
        assert along_axis(index, (wrench[:3], wrench[3:])) == pytest.approx(effort, rel=0.01)


@pytest.mark.parametrize("mode", ["POSITION_CONTROL", "VELOCITY_CONTROL", "TORQUE_CONTROL", "IMPEDANCE_CONTROL"])
def test_urdf_damping_is_subtracted_from_effort_along_a_moving_axis(world_of, mode):
    world = world_of(mode=mode)
    arm = world.bodies["arm"]
    for link in arm.link_indices:
        world.pb.changeDynamics(arm.body_id, link, linearDamping=0.0, angularDamping=0.0)
    velocities = dict(zip(MOVING, (1.5, 0.4, -1.2), strict=True))
    put(world, dict.fromkeys(MOVING, 0.0), velocities)
    positions = [0.005 * rate for rate in velocities.values()]
    world.put("arm/target", JointCommand(MOVING_JOINTS, positions, list(velocities.values()), [2.0, -3.0, 0.5]))
    step(world, 5)
    _, before = joint_state(world)
    samples = world.step()
    states = next(sample for sample in samples if isinstance(sample, JointStateSample))
    efforts = dict(zip(states.joint_names, states.effort, strict=True))
    wrenches_of = {sample.name: sample for sample in samples if isinstance(sample, WrenchSample)}
    for index in MOVING:
        wrench = wrenches_of[f"arm/{JOINTS[index]}"]
        expected = efforts[JOINTS[index]] - DAMPING * before[index]
        assert along_axis(index, (wrench.force, wrench.torque)) == pytest.approx(expected, rel=0.01, abs=0.01)


def test_joint_at_its_limit_reads_the_load_on_its_stop(world_of):
    description = urdf().replace('lower="-3" upper="3"', 'lower="-0.2" upper="0.2"')
    world = world_of(mode="TORQUE_CONTROL", description=description)
    still = dict.fromkeys(MOVING, 0.0)
    put(world, {**still, 2: 0.2}, still)
    found = step(world, 5000)
    q, dq = joint_state(world)
    assert any(abs(position) > 0.199 for position in q.values()) and max(map(abs, dq.values())) < 1e-3
    for joint, (force, moment) in zip(JOINTS, wrenches(q, still, still), strict=True):
        assert_within_one_percent(found[joint], np.concatenate([force, moment]), joint)


# The idle link is there since, in PyBullet 3.2.7, contacts do not push links that hang by a fixed joint on a body with
# one movable joint.
PUSHER = """<robot name="pusher"><link name="base"/>
<link name="idle"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="idler" type="revolute"><parent link="base"/><child link="idle"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="5" velocity="5"/></joint>
<link name="ram"><inertial><mass value="1.0"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tip"><inertial><origin xyz="0 0 -0.1"/><mass value="0.5"/>
<inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0.03 0 -0.1"/><geometry><sphere radius="0.05"/></geometry></collision></link>
<joint name="drive" type="prismatic"><parent link="base"/><child link="ram"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="500" velocity="5"/></joint>
<joint name="mount" type="fixed"><parent link="ram"/><child link="tip"/>
<origin xyz="0 0 -0.2" rpy="0 0 1.5707963267948966"/></joint>
</robot>"""


def beside_arm(world, arm_last, put):
    """Puts something into the world. Who came first decides who is A and who is B in PyBullet's contacts."""
    kind, config = world.log[-1].arguments
    if arm_last:
        world.remove("arm")
    put()
    if arm_last:
        world.add(kind, config)


def put_floor(world, arm_last, tilt=0.0, **dynamics):
    pb = world.pb
    position, quat = [-0.1 * math.sin(tilt), 0.0, -0.1 * math.cos(tilt)], pb.getQuaternionFromEuler([0, tilt, 0])

    def put():
        shape = pb.createCollisionShape(pb.GEOM_BOX, halfExtents=[9, 9, 0.1])
        pb.changeDynamics(pb.createMultiBody(0, shape, -1, position, quat), -1, **dynamics)

    beside_arm(world, arm_last, put)


@pytest.mark.parametrize("substeps", [0, 4])
@pytest.mark.parametrize("arm_last", [True, False], ids=["arm last", "arm first"])
def test_payload_that_presses_on_a_slope_reads_the_contact(world_of, substeps, arm_last):
    """A ram pushes a ball down on a frictionless slope: statics give all six components without PyBullet."""
    main = {"setPhysicsEngineParameter": {"numSubSteps": substeps}} if substeps else {}
    world = world_of(mode="TORQUE_CONTROL", sensors=["drive", "mount"], main=main, description=PUSHER)
    slope = 0.4
    normal = np.array([math.sin(slope), 0.0, math.cos(slope)])
    put_floor(world, arm_last, slope, lateralFriction=0.0)
    world.put("arm/target", JointCommand(["drive"], (), (), [-40.0]))
    found = step(world, 4000)
    load = 40.0 + 1.5 * 9.81
    contact = load * np.array([math.tan(slope), 0.0, 1.0])
    ram = np.array([0.0, 0.0, -40.0])  # along the drive, plus what its guide takes sideways
    ram[0] = -contact[0]
    assert found["drive"][:3] == pytest.approx(ram, rel=0.01, abs=0.05)
    mount = np.array([-contact[0], 0.0, 0.5 * 9.81 - contact[2]])
    quarter_turn = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    assert found["mount"][:3] == pytest.approx(quarter_turn @ mount, rel=0.01, abs=0.05)
    centre = np.array([0.0, 0.03, -0.1])  # of the ball, in the axes of the ram; the mount turns x to y
    touch = centre - 0.05 * normal
    moment = -np.cross(touch, contact) - np.cross([0.0, 0.0, -0.1], [0.0, 0.0, -0.5 * 9.81])
    assert found["mount"][3:] == pytest.approx(quarter_turn @ moment, rel=0.01, abs=0.02)


@pytest.mark.parametrize("arm_last", [True, False], ids=["arm last", "arm first"])
@pytest.mark.parametrize("shape", ["sphere", "box"])
def test_payload_that_slides_reads_friction_and_acceleration(world_of, shape, arm_last):
    """A carriage drags the ram and its payload over a floor: friction is 0.5 * 0.6 times what presses."""
    carriage = (
        PUSHER.replace('type="revolute"', 'type="prismatic"')
        .replace('<child link="idle"/><axis xyz="0 0 1"/>', '<child link="idle"/><axis xyz="1 0 0"/>')
        .replace('<parent link="base"/><child link="ram"/>', '<parent link="idle"/><child link="ram"/>')
    )
    if shape == "box":
        carriage = carriage.replace('<sphere radius="0.05"/>', '<box size="0.1 0.1 0.1"/>')
    world = world_of(mode="TORQUE_CONTROL", sensors=["mount"], description=carriage, enforce_effort_limits=False)
    put_floor(world, arm_last, lateralFriction=0.6)
    pb, arm = world.pb, world.bodies["arm"]
    pb.changeDynamics(arm.body_id, arm.model["mount"].index, lateralFriction=0.5)
    world.put("arm/target", JointCommand(["idler", "drive"], (), (), [0.0, -20.0]))
    step(world, 2000)
    world.put("arm/target", JointCommand(["idler"], (), (), [15.0]))
    step(world, 300)
    slider = arm.model["idler"].index
    before = pb.getJointState(arm.body_id, slider)[1]
    found = step(world)["mount"]
    acceleration = (pb.getJointState(arm.body_id, slider)[1] - before) / DT_S
    pressing = 20.0 + 1.5 * 9.81
    assert acceleration == pytest.approx((15.0 - 0.3 * pressing) / 2.5, rel=0.02), "it slides"
    along = 0.5 * acceleration + 0.3 * pressing  # in the mount's axes, x of the world is -y
    assert found[:3] == pytest.approx([0.0, -along, 0.5 * 9.81 - pressing], rel=0.01, abs=0.05)
    if shape == "sphere":  # of a box, it is open where it presses most
        touch, contact = [0.0, 0.03, -0.15], [-0.3 * pressing, 0.0, pressing]
        moment = np.cross([0.0, 0.0, -0.1], [0.5 * acceleration, 0.0, 0.0]) - np.cross(touch, contact)
        assert found[3:] == pytest.approx([moment[1], -moment[0], moment[2]], rel=0.01, abs=0.02)


TRAY = """<robot name="tray"><link name="base"/>
<link name="idle"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="idler" type="revolute"><parent link="base"/><child link="idle"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="5" velocity="5"/></joint>
<link name="cart"><inertial><mass value="1.0"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
<limit lower="-9" upper="9" effort="500" velocity="5"/></joint>
<link name="tray"><inertial><mass value="0.5"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.4 0.4 0.02"/></geometry></collision></link>
<joint name="mount" type="fixed"><parent link="cart"/><child link="tray"/></joint></robot>"""


@pytest.mark.parametrize("arm_last", [True, False], ids=["arm last", "arm first"])
def test_box_on_a_tray_is_carried_and_accelerated_by_friction(world_of, arm_last):
    world = world_of(mode="TORQUE_CONTROL", sensors=["mount"], description=TRAY)
    pb = world.pb

    def put_box():
        pb.createMultiBody(2.0, pb.createCollisionShape(pb.GEOM_BOX, halfExtents=[0.05] * 3), -1, [0.0, 0.0, 0.06])

    beside_arm(world, arm_last, put_box)
    step(world, 300)
    world.put("arm/target", JointCommand(["slide"], (), (), [3.0]))
    found = step(world, 300)["mount"]
    per_kg = np.array([3.0 / 3.5, 0.0, 9.81])
    assert found[:3] == pytest.approx(2.5 * per_kg, rel=0.01, abs=0.02)
    assert found[3:] == pytest.approx(np.cross([0.0, 0.0, 0.06], 2.0 * per_kg), rel=0.02, abs=0.005)


def test_robot_in_free_fall_feels_no_weight(world_of):
    world = world_of(mode="TORQUE_CONTROL", fixed=False)
    found = step(world, 50)
    weight = 9.81 * sum(link.mass for link in ARM)
    assert all(np.linalg.norm(wrench[:3]) < 0.01 * weight for wrench in found.values())


def test_robot_on_a_mobile_base_feels_its_weight(world_of):
    world = world_of(planar_base={}, sensors=["upper_joint"])
    step(world, 500)
    standing = np.linalg.norm(step(world)["upper_joint"][:3])
    assert standing == pytest.approx(9.81 * sum(link.mass for link in ARM), rel=1e-3)


def test_resetting_joints_leaves_no_peak_in_the_reading(world_of):
    world = world_of(sensors=["upper_joint"])
    weight = np.linalg.norm(step(world, 300)["upper_joint"][:3])
    arm = world.bodies["arm"]
    for position in (0.5, -0.5, 1.0):
        arm.set_joint_state(JointCommand(["wrist_joint"], [position]))
        assert np.linalg.norm(step(world)["upper_joint"][:3]) == pytest.approx(weight, rel=0.05)


def test_child_on_parent_is_the_opposite_of_parent_on_child(tmp_path):
    found = []
    for acting in ("parent_on_child", "child_on_parent"):
        folder = tmp_path / acting
        folder.mkdir()
        world = make_world(folder, sensors=[{"joint": "flange_joint", "acting": acting}])
        found.append(step(world, 50)["flange_joint"])
        world.close()
    assert found[0] == pytest.approx(-found[1], rel=1e-9)


HOOK = """<robot name="hook"><link name="base"/><link name="load"><inertial><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hook" type="fixed"><parent link="base"/><child link="load"/></joint></robot>"""


@pytest.mark.quick
def test_hanging_payload_reads_its_weight_upwards(world_of):
    """The release's sign: the parent holds two kilogrammes up with +19.62 N."""
    found = step(world_of(sensors=["hook"], description=HOOK), 10)["hook"]
    assert found == pytest.approx([0, 0, 19.62, 0, 0, 0], abs=1e-6)


def samples(world, ticks):
    return [sample for _ in range(ticks) for sample in world.step() if isinstance(sample, WrenchSample)]


def six(found):
    return np.array([[*sample.force, *sample.torque] for sample in found])


def test_each_sensor_has_its_own_rate_and_frame(world_of):
    sensors = [{"joint": "wrist_joint", "hz": 100}, {"joint": "flange_joint", "frame_id": "tool0"}, "payload_joint"]
    found = samples(world_of(sensors=sensors, joint_state_publisher_hz=25), 1000)
    frames = {(sample.name, sample.frame_id) for sample in found}
    assert frames == {
        ("arm/wrist_joint", "rpbi/arm/wrist"),
        ("arm/flange_joint", "tool0"),
        ("arm/payload_joint", "rpbi/arm/payload"),
    }
    counts = [sum(sample.name == name for sample in found) for name, _ in sorted(frames)]
    assert counts == [25, 25, 100]


def test_samples_begin_after_the_first_tick_one_per_tick(world_of):
    world = world_of(sensors=[{"joint": "flange_joint", "hz": 10}])
    assert not [sample for sample in world.read_rest() if isinstance(sample, WrenchSample)]
    for _ in range(3):
        world.step()
        assert len([sample for sample in world.read_rest() if isinstance(sample, WrenchSample)]) == 1


def test_mass_that_is_changed_is_weighed(world_of):
    world = world_of(sensors=["payload_joint"])
    before = step(world, 500)["payload_joint"]
    world.change_dynamics("arm/payload", ChangeDynamics(mass=6.0))
    after = step(world, 500)["payload_joint"]
    assert np.linalg.norm(after[:3]) == pytest.approx(2 * np.linalg.norm(before[:3]), rel=1e-3)


@pytest.mark.thorough
def test_noise_and_bias_are_as_configured_over_100_000_samples(world_of):
    sigma, bias = [0.5, 0.2, 0.1, 0.02, 0.01, 0.05], [1.0, -2.0, 3.0, 0.1, -0.2, 0.3]
    sensor = {
        "joint": "hook",
        **{"noise_force_n": sigma[:3], "noise_torque_nm": sigma[3:], "seed": 7},
        **{"bias_force_n": bias[:3], "bias_torque_nm": bias[3:]},
    }
    values = six(samples(world_of(sensors=[sensor], description=HOOK), 100_000)) - [0, 0, 19.62, 0, 0, 0]
    assert np.std(values, axis=0) == pytest.approx(sigma, rel=0.01)
    assert np.mean(values, axis=0) == pytest.approx(bias, rel=0.01)
    assert np.abs(np.corrcoef(values.T) - np.eye(6)).max() < 0.01, "axes are independent"
    lagged = [np.corrcoef(values[1:, axis], values[:-1, axis])[0, 1] for axis in range(6)]
    assert np.abs(lagged).max() < 0.01, "ticks are independent"


def test_single_noise_value_applies_to_each_axis(world_of):
    sensor = {"joint": "hook", "noise_force_n": 0.3, "noise_torque_nm": 0.1}
    values = six(samples(world_of(sensors=[sensor], description=HOOK), 10_000))
    assert np.std(values, axis=0) == pytest.approx([0.3] * 3 + [0.1] * 3, rel=0.05)


def test_noise_is_reproducible_whatever_was_read_in_between(tmp_path):
    runs = []
    for name, peeks in (("a", False), ("b", True)):
        folder = tmp_path / name
        folder.mkdir()
        world = make_world(folder, sensors=[{"joint": "flange_joint", "hz": 100, "noise_force_n": 1.0}])
        run = []
        for _ in range(600):
            run += [sample for sample in world.step() if isinstance(sample, WrenchSample)]
            if peeks:
                world.read_rest()
        runs.append(run)
        world.close()
    assert runs[0] == runs[1]


def test_noise_differs_by_sensor_and_by_seed(world_of):
    joints = ("wrist_joint", "side_joint", "flange_joint", "payload_joint")
    seeds = dict(zip(joints, (None, None, 1, 2)))
    sensors = [{"joint": joint, "seed": seed, "noise_torque_nm": 100.0} for joint, seed in seeds.items()]
    found = six(samples(world_of(sensors=sensors), 500)).reshape(500, 4, 6)[:, :, 3]
    assert np.abs(np.corrcoef(found.T) - np.eye(4)).max() < 0.2


def test_low_pass_runs_at_every_tick_whatever_the_rate(world_of):
    """A mass that is changed is a step of the weight: 1 - exp(-2 pi f t) of it shows after t."""
    cutoff_hz = 5.0
    world = world_of(sensors=[{"joint": "hook", "hz": 50, "low_pass_hz": cutoff_hz}], description=HOOK)
    step(world, 100)
    world.change_dynamics("arm/load", ChangeDynamics(mass=5.0))
    forces = [sample.force[2] for sample in samples(world, 200)]
    grown = [1 - math.exp(-2 * math.pi * cutoff_hz * 0.02 * (1 + n)) for n in range(10)]
    assert forces == pytest.approx([9.81 * (2.0 + 3.0 * part) for part in grown])


def test_non_finite_wrench_is_never_reported(world_of):
    world = world_of(sensors=["flange_joint"], joint_state_publisher_hz=1)
    arm = world.bodies["arm"]
    step(world, 1)
    world.pb.resetJointState(arm.body_id, arm.model["wrist_joint"].index, 0.0, float("nan"))
    world.step()
    with pytest.raises(PhysicsError, match="arm/flange_joint: wrench is not finite any more at tick 2"):
        world.sensors_of("arm")[1].read(2)


def test_zeroing_takes_the_mean_of_the_coming_samples_for_zero(world_of):
    sensor_config = {"joint": "payload_joint", "hz": 500, "noise_force_n": 0.1, "bias_force_n": [5.0, 0.0, 0.0]}
    world = world_of(sensors=[sensor_config])
    step(world, 200)
    sensor = world.sensors_of("arm")[1]
    zeroing = sensor.zero(100)
    assert sensor.zero(100) is zeroing, "two who ask at once get the same zero"
    before = np.array([sample.force for sample in samples(world, 198)])
    assert len(before) == 99 and not zeroing.mean.done()
    last = np.array([sample.force for sample in samples(world, 2)])
    assert zeroing.mean.done()
    after = np.array([sample.force for sample in samples(world, 1000)])
    assert np.abs(before.mean(axis=0)).max() > 5.0
    assert after.mean(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=0.05)
    assert len(last) == 1


def test_zeroing_that_is_given_up_leaves_the_old_zero(world_of):
    world = world_of(sensors=["payload_joint"])
    before = step(world, 300)["payload_joint"]
    sensor = world.sensors_of("arm")[1]
    sensor.zero(100)
    step(world, 50)
    sensor.cancel_zeroing()
    assert step(world, 300)["payload_joint"] == pytest.approx(before, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize(
    ("sensors", "key", "message"),
    [
        (["wirst_joint"], "enabled_joint_force_torque_sensors[0]", "unknown joint 'wirst_joint': known are upper"),
        (["wrist_joint", {"joint": "wrist_joint"}], "enabled_joint_force_torque_sensors[1]", "has a sensor already"),
        ([{"joint": "wrist_joint", "hz": 0}], "enabled_joint_force_torque_sensors[0].hz", "must be > 0 [Hz], got 0"),
        ([{"joint": "wrist_joint", "acting": "up"}], "enabled_joint_force_torque_sensors[0].acting", "parent_on_child"),
        ([{"hz": 5}], "enabled_joint_force_torque_sensors[0].joint", "missing"),
        ([{"joint": "a", "noise_force_n": -1}], "enabled_joint_force_torque_sensors[0].noise_force_n", "must be >= 0"),
        ([{"joint": "a", "bias_force_n": [1, 2]}], "enabled_joint_force_torque_sensors[0].bias_force_n", "3 numbers"),
        ([{"joint": "a", "low_pass": 5}], "enabled_joint_force_torque_sensors[0].low_pass", "low_pass_hz"),
        ([{"joint": "a", "seed": -5}], "enabled_joint_force_torque_sensors[0].seed", "must be >= 0"),
        ([3], "enabled_joint_force_torque_sensors[0]", "got 3"),
        ("wrist_joint", "enabled_joint_force_torque_sensors", "expected a list"),
    ],
)
def test_faulty_sensor_options_are_named_with_their_key(world_of, sensors, key, message):
    with pytest.raises(ConfigError) as caught:
        world_of(sensors=sensors)
    problems = {problem.key: f"{problem.file} {problem.message}" for problem in caught.value.problems}
    assert any(found.startswith(key) and message in text for found, text in problems.items()), problems


def test_joints_that_topics_cannot_be_named_after_are_refused(world_of):
    with pytest.raises(ConfigError, match="may only have letters, digits"):
        world_of(sensors=["wrist-joint"], description=urdf().replace("wrist_joint", "wrist-joint"))


def test_visual_robots_have_none(world_of):
    world = world_of(is_visual_robot=True, sensors=["wrist_joint"])
    assert not samples(world, 100)
