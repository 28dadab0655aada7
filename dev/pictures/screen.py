"""Pictures of windows: a ROS master, launch files and windows on a virtual screen that only the picture sees."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, TypeVar
from xmlrpc.client import ServerProxy

import rosgraph
import rospy
import yaml
from PIL import Image, ImageChops, ImageGrab
from rviz.srv import SendFilePath
from rviz_view import rviz_content
from std_msgs.msg import String
from std_srvs.srv import Trigger

from custom_ros_tools.child_process import kill_with_children
from custom_ros_tools.ros.lifecycle.timed_master import unused_port

T = TypeVar("T")

SUPERSAMPLING = 2
"""Rows and columns of the screen for each row and column of the picture."""
PATIENCE_S = 400.0
"""Longest wait for a window or a state [s]."""
POLL_S = 0.1
STARTS_S = 30.0
"""Longest time in which a launch file sets its parameters [s]."""
ATTEMPTS, OPENS_S = 3, 60.0
"""Number of starts of RViz, and longest time until it draws [s]."""
STILL_S = 4.0
"""Time without a change after which a window counts as drawn [s]."""
FRAMES, SETTLING_FRAMES = 3, 30
"""Number of RViz's frames between two looks at the screen, and after it has connected to all topics."""
STOP_S = 30.0
"""Longest wait for the end of a program after SIGINT [s]."""
COLOURS = 50
"""A screen with fewer colours has no drawn window."""


def wait_until(condition: Callable[[], T], meaning: str, timeout_s: float = PATIENCE_S) -> T:
    """Waits until a condition is true, and returns its value.

    Raises:
        TimeoutError: If the condition stays false; the message names its meaning.
    """
    end_s = time.monotonic() + timeout_s
    while not (value := condition()):
        if time.monotonic() > end_s:
            raise TimeoutError(f"not within {timeout_s:g} s: {meaning}")
        time.sleep(POLL_S)
    return value


def next_message(topic: str, kind: type, condition: Callable[[Any], bool] = lambda _: True) -> Any:
    """Waits for a message that fulfils a condition, and returns it.

    Raises:
        TimeoutError: If there is none.
    """
    found: queue.Queue[Any] = queue.Queue()
    subscriber = rospy.Subscriber(topic, kind, lambda each: found.put(each) if condition(each) else None, queue_size=10)
    try:
        return found.get(timeout=PATIENCE_S)
    except queue.Empty:
        raise TimeoutError(f"no such message on {topic} within {PATIENCE_S:g} s") from None
    finally:
        subscriber.unregister()


def unconnected(node: str) -> set[str]:
    """Returns the topics that a node subscribes and others publish, but to which it is not connected yet."""
    master = rosgraph.Master("/pictures")
    published, subscribed, _ = master.getSystemState()
    wanted = {topic for topic, nodes in subscribed if node in nodes}
    offered = {topic for topic, nodes in published if set(nodes) - {node}}
    connections = ServerProxy(master.lookupNode(node)).getBusInfo("/pictures")[2]
    return (wanted & offered) - {topic for _, _, direction, _, topic, *_ in connections if direction == "i"}


class Latest:
    """The latest message of a topic.

    Args:
        topic: Name of the topic.
        kind: Type of its messages.
    """

    def __init__(self, topic: str, kind: type) -> None:
        self.message: Any = None
        self._subscriber = rospy.Subscriber(topic, kind, self._store, queue_size=1)

    def _store(self, message: Any) -> None:
        self.message = message


def call(service: str) -> None:
    """Calls a service without arguments as soon as it is there."""
    rospy.wait_for_service(service, PATIENCE_S)
    rospy.ServiceProxy(service, Trigger)()


class Stage:
    """A virtual screen and a ROS master, on which launch files and windows run until the `with` block ends.

    The process is a node of this master and can publish topics and call services.

    Args:
        width: Columns of the picture [px].
        height: Rows of the picture [px].
        scale: Rows and columns of the screen for each of the picture. Text in windows becomes smaller by this factor.
    """

    def __init__(self, width: int = 1280, height: int = 800, scale: int = SUPERSAMPLING) -> None:
        self.width, self.height, self.scale = width, height, scale
        self._exits = ExitStack()
        self._saved: list[Path] = []

    def __enter__(self) -> Stage:
        """Starts the screen and the master."""
        try:
            self._start_screen()
            port = unused_port()
            os.environ.update({"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1"})
            self.start(["roscore", "-p", str(port)], stdout=subprocess.DEVNULL)
            wait_until(rosgraph.is_master_online, "a ROS master runs")
            rospy.init_node("pictures", disable_signals=True)
        except BaseException:
            self._exits.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Ends all started programs, the latest first."""
        rospy.signal_shutdown("the picture is drawn")
        self._exits.close()

    def _start_screen(self) -> None:
        reader, writer = os.pipe()
        size = f"{self.width * self.scale}x{self.height * self.scale}x24"
        screen = ["Xvfb", "-displayfd", str(writer), "-screen", "0", size, "-nolisten", "tcp", "-noreset"]
        self.start(screen, pass_fds=[writer], stderr=subprocess.DEVNULL)
        os.close(writer)
        with os.fdopen(reader) as answer:
            os.environ.update({"DISPLAY": f":{answer.readline().strip()}", "LIBGL_ALWAYS_SOFTWARE": "1"})

    def start(self, command: Sequence[object], **options: Any) -> subprocess.Popen[bytes]:
        """Starts a program, and ends it by SIGINT with its children when the `with` block ends."""
        process = subprocess.Popen([*map(str, command)], start_new_session=True, **options)
        self._exits.callback(_stop, process)
        return process

    def launch(self, name: str, *arguments: str, package: str = "rpbi_examples") -> subprocess.Popen[bytes]:
        """Starts a launch file without RViz; see `rviz`.

        RViz would show frames by wall time, and hide those of a stopped world, if it started before the launch file has
        set `/use_sim_time`. A launch file without a world does not set it.
        """
        process = self.start(["roslaunch", package, name, "rviz:=false", *arguments])
        with suppress(TimeoutError):
            wait_until(lambda: rospy.has_param("/use_sim_time"), "ROS has simulated time or not", STARTS_S)
        return process

    def rviz(self, config: Path, displays: Mapping[str, Mapping[str, Any] | None] | None = None, **view: Any) -> None:
        """Opens RViz over the whole screen with only its 3-D view, and waits until it draws.

        Debian's RViz sometimes crashes or hangs while it starts; then it is started again.

        Args:
            config: The `.rviz` file.
            displays: Properties that replace those of displays, or None to remove the display, indexed by its name. A
                display with the property `Class` is added.
            view: Properties of the view that replace those of the file, with `_` for spaces, such as `Distance=1.5`
                [m] or `Focal_Point={"X": 0.0, "Y": 0.0, "Z": 0.5}` [m].
        """
        properties = {name.replace("_", " "): each for name, each in view.items()}
        content = rviz_content(config, displays or {}, properties, self.scale)
        content["Window Geometry"] = {
            "X": 0,
            "Y": 0,
            "Width": self.width * self.scale,
            "Height": self.height * self.scale,
        }
        folder = self._exits.enter_context(tempfile.TemporaryDirectory())
        path = Path(folder) / "view.rviz"
        path.write_text(yaml.safe_dump(content), encoding="utf-8")
        self._saved = [Path(folder) / "saved.rviz"]
        for attempt in range(1, ATTEMPTS + 1):
            process = self.start(["rviz", "--fullscreen", "--splash-screen", "", "-d", path, "__name:=rviz"])
            try:
                wait_until(lambda: len(self.picture().getcolors(1 << 24) or ()) > COLOURS, "RViz draws", OPENS_S)
                break
            except TimeoutError:
                if attempt == ATTEMPTS:
                    raise
                _stop(process)
        wait_until(lambda: not unconnected("/rviz"), "RViz is connected to all topics that it shows")
        self._let_rviz_work(SETTLING_FRAMES)

    def stop_world(self, namespace: str = "") -> None:
        """Stops the simulation, so that windows show one tick."""
        call(f"{namespace}/rpbi/stop")

    def picture(self) -> Image.Image:
        """Returns the screen without cursor, in the size of the picture."""
        return ImageGrab.grab(xdisplay=os.environ["DISPLAY"]).convert("RGB").reduce(self.scale)

    def still_picture(self) -> Image.Image:
        """Returns the screen as soon as it has not changed for `STILL_S`; the world must stand still."""
        before, since_s = self.picture(), time.monotonic()

        def is_still() -> bool:
            nonlocal before, since_s
            self._let_rviz_work(FRAMES)
            now = self.picture()
            if ImageChops.difference(now, before).getbbox():
                before, since_s = now, time.monotonic()
            return time.monotonic() - since_s > STILL_S

        wait_until(is_still, "the screen stands still")
        return before

    def _let_rviz_work(self, frames: int) -> None:
        """Waits for some frames of RViz, if it is open: its services answer between frames."""
        for path in self._saved * frames:
            rospy.wait_for_service("rviz/save_config", PATIENCE_S)
            rospy.ServiceProxy("rviz/save_config", SendFilePath)(String(str(path)))


def _stop(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGINT)
        try:
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            kill_with_children(process)
