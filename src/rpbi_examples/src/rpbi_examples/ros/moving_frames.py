"""Nodes that broadcast moving TF frames: a camera that orbits the scene, and a frame that moves in a figure eight."""

from collections.abc import Callable

import rospy
from numpy.typing import ArrayLike

from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.services import Toggle, ToggleService
from custom_ros_tools.ros.tf_interface import NO_ROTATION, TfInterface
from rpbi_examples.motions import FigureEight, camera_pose

HZ = 50.0


def orbit() -> None:
    """Runs the node that moves the frame `~child_frame_id` in a circle around the scene. Default: `rpbi/camera`."""
    run_node("orbit", lambda: _move("rpbi/world", rospy.get_param("~child_frame_id", "rpbi/camera"), camera_pose, HZ))


def figure_eight() -> None:
    """Runs the node that moves the frame `figure_eight` along a figure eight in the frame `figure_eight_base`."""
    run_node("figure_eight", _FigureEightNode)


class _FigureEightNode:
    """Broadcasts the frame `figure_eight` until ROS shuts down. While the node is switched off, the frame is at rest.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        figure = private_parameters(FigureEight)
        self._time_s, self._last_s, self._moves = 0.0, 0.0, False
        moving = Toggle("figure eight", lambda: self._switch(True), lambda: self._switch(False))
        if figure.start_on_init:
            moving.on()
        ToggleService("toggle_figure_eight", moving.on, moving.off)
        parent, child = figure.frame("figure_eight_base"), figure.frame("figure_eight")
        _move(parent, child, lambda now_s: (figure.position(self._own_time_s(now_s)), NO_ROTATION), figure.hz)

    def _switch(self, on: bool) -> None:
        self._moves = on

    def _own_time_s(self, now_s: float) -> float:
        """Returns the total time for which the frame has moved [s], given the time since the start of the node [s]."""
        if self._moves:
            self._time_s += now_s - self._last_s
        self._last_s = now_s
        return self._time_s


def _move(parent: str, child: str, pose: Callable[[float], tuple[ArrayLike, ArrayLike]], hz: float) -> None:
    """Broadcasts a moving TF frame until ROS shuts down.

    Args:
        parent: Name of the parent frame.
        child: Name of the moving frame.
        pose: Returns position [m] and orientation (x, y, z, w) at a ROS time since the start [s].
        hz: Rate [Hz].
    """
    tf = TfInterface()
    start = last = rospy.Time.now()
    rate = rospy.Rate(hz)
    try:
        while not rospy.is_shutdown():
            now = rospy.Time.now()
            if now > last:  # TF warns of a repeated stamp
                message = tf.pack_tf_msg(parent, child, *pose((now - start).to_sec()))
                message.header.stamp = last = now
                tf.tf_broadcaster.sendTransform(message)
            rate.sleep()
    except rospy.ROSException:
        if not rospy.core.is_shutdown_requested():  # Ctrl-C during a sleep, or while the topic closes
            raise
