"""The command `demo`: runs an example, records its topics, and writes tables and pictures of the recording."""

from __future__ import annotations

import json
import logging
import math
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import rosgraph
from sensor_msgs.msg import Image
from tf2_msgs.msg import TFMessage

from custom_ros_tools.child_process import kill_with_children
from custom_ros_tools.console.argument import Argument, UsageError
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.timed_master import unused_port
from custom_ros_tools.ros.transform_messages import position_in, quat_in
from robot_model.geometry import Pose
from rpbi.ros.publishers.status import MAX_CLOCK_HZ
from rpbi.world.loading import LoadedWorld, load_world
from rpbi_data import Recorder, bag_to_dataframes
from rpbi_data.bags.bag_reader import BagReader
from rpbi_examples import demo_report
from rpbi_examples.draw_rate import draw_rate_hz
from rpbi_examples.ros.joint_targets import HZ as TARGET_HZ

EXAMPLE = "basic_example_kuka_lwr"
WORLD = "{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml"
STATES = "/rpbi/kuka_lwr/joint_states"
TARGETS = "/rpbi/kuka_lwr/joint_states/target"
CONTACTS, WRIST = "/rpbi/box/contacts", "/rpbi/kuka_lwr/lwr_arm_6_joint/ft_sensor"
COLOUR, DEPTH = "/rpbi/camera/colour/image", "/rpbi/camera/depth/image"
REQUIRED_TOPICS = (STATES, "/tf")
"""Topics that must have messages even on a slow machine."""
REPLAY_TOPICS = ("/rpbi/world_description", "/rpbi/state", "/rpbi/commands")
CAMERA_TOPICS = (COLOUR, DEPTH, "/rpbi/camera/colour/camera_info", "/rpbi/camera/depth/camera_info")
START_TIMEOUT_S = 180.0
STOP_TIMEOUT_S = 30.0
DRAW_S = 2.0
"""Duration of the measurement of the drawing rate [s]."""
ENDINGS = (signal.SIGTERM, signal.SIGHUP)
"""Signals that end the demo and all of its nodes, as Ctrl-C does."""


def demo(
    *,
    seconds: Annotated[float, Argument("S", parse=float)] = 10.0,
    headless: Annotated[bool, Argument("")] = False,
    strict: Annotated[bool, Argument("")] = False,
    out: Annotated[Path, Argument("FOLDER", parse=Path, files="*")] = Path("out/demo"),
) -> int:
    """Simulates a KUKA arm that pushes a box, records topics and camera images, and writes plots and tables.

    The demo runs on a separate ROS master. `./rpbi replay` simulates the recording again and compares the states.

    Args:
        seconds: duration of the recording [s], 2 to 3600; default 10
        headless: does not open windows, even if a display is available
        strict: also fails if the machine is too slow for a topic's rate
        out: folder for pictures, tables and the recording; default out/demo
    """
    if not 2.0 <= seconds <= 3600.0:
        raise UsageError(f"--seconds: expected 2 to 3600, got {seconds:g}")
    logging.basicConfig(format="%(message)s", level=logging.WARNING)
    for number in ENDINGS:
        if signal.getsignal(number) == signal.SIG_DFL:  # nohup ignores one of them
            signal.signal(number, _leave)
    return _demo(out.resolve(), seconds, headless or not os.environ.get("DISPLAY"), strict)


def _leave(number: int, _: object) -> None:
    """Handles a signal: raises SystemExit, so that all `with` blocks clean up. Ignores further signals in `ENDINGS`."""
    for each in ENDINGS:
        signal.signal(each, signal.SIG_IGN)
    sys.exit(128 + number)


def _demo(out: Path, seconds: float, headless: bool, strict: bool) -> int:
    out.mkdir(parents=True, exist_ok=True)
    bag = out / "recording.bag"
    expected_hz = _expected_rates()
    with _example(headless, out / "launch.log"):
        topics = [*expected_hz, "/diagnostics", "/tf_static", *REPLAY_TOPICS]
        with Recorder(bag, topics, timeout_s=START_TIMEOUT_S):
            _start_world()  # recorded from the first tick on, with the arm at rest
            _say(f"recording {seconds:g} s of {len(expected_hz)} topics into {bag}")
            time.sleep(seconds)
    _say("reading the bag")
    summary = _report(bag, expected_hz, seconds, out)
    print(demo_report.as_text(summary), flush=True)
    _say(f"\nwritten to {out}: {', '.join(sorted(path.name for path in out.iterdir()))}")
    slow = demo_report.slow_lines(summary, CAMERA_TOPICS, WORLD)
    for line in slow:
        _say(f"SLOW: {line}")
    failures = demo_report.failures(summary, REQUIRED_TOPICS)
    for line in failures:
        _say(f"FAILED: {line}")
    return int(bool(failures or (strict and slow)))


@contextmanager
def _example(headless: bool, log: Path) -> Iterator[None]:
    """Runs the example on a separate ROS master for the duration of the `with` block."""
    port = unused_port()
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    os.environ["ROS_IP"] = "127.0.0.1"
    os.environ.pop("ROS_HOSTNAME", None)
    _say(f"launching {EXAMPLE} (ROS_MASTER_URI={os.environ['ROS_MASTER_URI']}, log: {log})")
    arguments = [f"headless:={headless}", "start:=false"]
    command = ["roslaunch", "-p", str(port), "rpbi_examples", f"{EXAMPLE}.launch", *arguments]
    with open(log, "w", encoding="utf-8") as output:
        process = subprocess.Popen(
            command, stdout=output, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, start_new_session=True
        )
    try:
        _wait_until_ready(process, log)
        yield
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            kill_with_children(process)


def _wait_until_ready(process: subprocess.Popen, log: Path) -> None:
    """Waits until the arm's targets and the colour images are published. These two topics start last."""
    end_s = time.monotonic() + START_TIMEOUT_S
    while time.monotonic() < end_s and process.poll() is None:
        if _is_published(TARGETS) and _is_published(COLOUR):
            return
        time.sleep(0.1)
    tail = "\n".join(log.read_text(errors="replace").splitlines()[-20:])
    raise InterfaceError(f"the example did not come up; the end of {log}:\n{tail}")


def _start_world() -> None:
    """Calls the service that starts the world. A separate process, `rosservice`, makes the call: rospy would suppress
    exceptions of signal handlers while waiting for the service.
    """
    command = ["rosservice", "call", "/rpbi/start"]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=START_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        raise InterfaceError(f"the world did not start: no answer within {START_TIMEOUT_S:g} s") from None
    if "success: True" not in answer.stdout:
        raise InterfaceError(f"the world did not start: {answer.stdout}{answer.stderr}")


def _is_published(topic: str) -> bool:
    try:
        publishers, _, _ = rosgraph.Master("/demo").getSystemState()
    except (OSError, rosgraph.MasterException):
        return False
    return any(name == topic for name, _ in publishers)


def _expected_rates() -> dict[str, float]:
    """Returns the configured rate of each topic [Hz], from the example's files."""
    world = load_world(WORLD)
    configs: dict[str, Any] = {item.config.name: item.config for item in world.objects}
    robot = configs["kuka_lwr"]
    camera = world.config.rgbd_sensor
    assert camera is not None
    rates = {
        STATES: robot.joint_state_publisher_hz,
        TARGETS: TARGET_HZ,
        WRIST: robot.joint_state_publisher_hz,
        CONTACTS: configs["box"].contacts.hz,
        "/tf": robot.broadcast_link_states_hz,
        "/clock": min(1.0 / world.config.timeStep, world.config.clock_hz or MAX_CLOCK_HZ),
    }
    return {**rates, **dict.fromkeys(CAMERA_TOPICS, camera.hz)}


def _report(bag: Path, expected_hz: dict[str, float], seconds: float, out: Path) -> dict[str, Any]:
    """Writes tables, pictures and the summary, and returns the summary.

    Rates are measured over the last part of the recording, since the recorder may connect late on a busy machine.
    """
    tables = bag_to_dataframes(bag, [STATES, TARGETS, WRIST, CONTACTS, "/clock", "/diagnostics"])
    states, targets, clock = tables[STATES], tables[TARGETS], tables["/clock"]["clock"]
    duration_s = float(clock.iloc[-1] - clock.iloc[0])
    measured_s = min(duration_s, demo_report.ENOUGH * seconds)
    rates = demo_report.measured_rates(_messages(bag, float(clock.iloc[-1]) - measured_s), expected_hz, measured_s)
    states.to_parquet(out / "joint_states.parquet", engine="fastparquet")
    demo_report.plot_joints(states, targets, out / "joints.png")
    error = demo_report.tracking_error(states, targets)
    demo_report.plot_efforts(states, list(error.index), out / "efforts.png")
    push = demo_report.contact_force(tables[CONTACTS], "kuka_lwr")
    world = load_world(WORLD)
    friction = _friction(world, "box", "floor") * demo_report.contact_force(tables[CONTACTS], "floor")
    demo_report.plot_forces(push, friction, tables[WRIST], states.index[0], out / "forces.png")
    assert world.config.rgbd_sensor is not None
    for picture in (out / "colour.png", out / "depth.png"):  # on a very busy machine there may be none
        picture.unlink(missing_ok=True)
    colour, depth = _middle_image(bag, COLOUR, np.uint8, 3), _middle_image(bag, DEPTH, np.float32, 1)
    if colour is not None:
        demo_report.save_colour(colour, out / "colour.png")
    if depth is not None:
        demo_report.save_depth(depth[:, :, 0], world.config.rgbd_sensor.intrinsics.range[1], out / "depth.png")
    diagnostics = _diagnostics(tables["/diagnostics"])
    camera = _static_pose(bag, world.config.rgbd_sensor.object_tf.tf_id)
    draw_rate = draw_rate_hz(WORLD, camera, DRAW_S, diagnostics["renderer"])
    summary = {
        "topics": rates.to_dict(orient="index"),
        "figures": {**diagnostics, "draw_rate_hz": round(draw_rate, 2),
                    "load_average": round(os.getloadavg()[0], 2), "cores": len(os.sched_getaffinity(0)),
                    "recorded_s": round(duration_s, 3), "measured_s": round(measured_s, 3),
                    "tracking_error_rms_rad": round(float(error["rms"].max()), 5),
                    "tracking_error_max_rad": round(float(error["max"].max()), 5),
                    **demo_report.force_figures(push),
                    "bag_mb": round(bag.stat().st_size / 1e6, 1)},
    }  # fmt: skip
    (out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    return summary


def _friction(world: LoadedWorld, *names: str) -> float:
    """Returns the coefficient of friction between objects: as in PyBullet, the product of the objects' coefficients."""
    configs: dict[str, Any] = {item.config.name: item.config for item in world.objects}
    return math.prod(configs[name].changeDynamics.lateralFriction for name in names)


def _diagnostics(table: pd.DataFrame) -> dict[str, Any]:
    """Returns real-time factor, number of overruns and renderer from the simulator's diagnostics."""
    own = table[table["name"].str.endswith(": simulation") & (table["message"] != "stopped")]
    overruns = own["values/overruns_total"].astype(int)
    return {
        "real_time_factor": round(float(own["values/real_time_factor"].astype(float).mean()), 4),
        "overruns": int(overruns.iloc[-1] - overruns.iloc[0]),
        "renderer": own["values/camera_renderer"].iloc[-1],
    }


def _messages(bag: Path, since_s: float) -> dict[str, int]:
    """Returns the number of messages of each topic, from a given ROS time [s] to the end of the bag."""
    with BagReader(bag) as recording:
        return Counter(each.topic for each in recording.messages(recording.types) if each.record_time_s >= since_s)


def _static_pose(bag: Path, frame: str) -> Pose:
    """Reads the pose of a static TF frame, in its parent frame, from the recording."""
    with BagReader(bag) as recording:
        for each in recording.messages(["/tf_static"]):
            message = TFMessage()
            message.deserialize(each.raw)
            for one in message.transforms:
                if one.child_frame_id == frame:
                    x, y, z, w = quat_in(one.transform).tolist()
                    return Pose(tuple(position_in(one.transform).tolist()), (x, y, z, w))
    raise InterfaceError(f"{bag}: /tf_static does not have {frame}")


def _middle_image(bag: Path, topic: str, dtype: type, channels: int) -> np.ndarray | None:
    """Returns the middle image of a topic, shape (height, width, channels). None if the topic has no image."""
    with BagReader(bag) as recording:
        count = recording.counts.get(topic, 0)
        for number, each in enumerate(recording.messages([topic])):
            if number == count // 2:
                message = Image()
                message.deserialize(each.raw)
                return np.frombuffer(message.data, dtype).reshape(message.height, message.width, channels)
    return None


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
