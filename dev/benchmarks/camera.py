"""Joint states at 1 kHz with a camera of 640x480 pixels at 30 Hz, with images and with point clouds.

The reference only publishes, or only draws.
"""

from __future__ import annotations

import sys

from bench_worlds import CAMERA, arm_world, write_main
from loop import publisher_alone
from result import Result, Target
from session import CLOUD, COLOUR, DEPTH, JOINT_STATES, Session

HZ = 1000
LONGEST_CLOUD_MS = 15.0


def run(quick: bool) -> list[Result]:
    """Measures both rates, as other processes receive them, the loop's lateness, and how long a cloud takes."""
    seconds = 6.0 if quick else 30.0
    floor = publisher_alone(HZ, seconds / 2)
    with Session() as ros:
        world = arm_world(ros.folder, HZ, rgbd_sensor=CAMERA)
        alone = ros.program("render_alone", write_main(ros.folder, world), seconds / 2)
        images_alone = ros.result_of(alone)
        delays_ms = ros.result_of(ros.program("cloud_alone", seconds / 6))
        ros.place_camera()
        ros.simulator(world)
        images = ros.watch(COLOUR, DEPTH, seconds=seconds)
        found = ros.watch(JOINT_STATES, seconds=seconds).arrivals()[JOINT_STATES]
        seen = images.arrivals()
        busy = ros.start(["nice", "-n", "19", sys.executable, "-c", "while True: pass"])
        beside_busy = ros.watch(COLOUR, seconds=seconds).arrivals()[COLOUR]
        ros.stop(busy)
    with Session() as ros:
        ros.place_camera()
        ros.simulator(arm_world(ros.folder, HZ, rgbd_sensor={**CAMERA, "pointcloud": True}))
        clouds = ros.watch(CLOUD, seconds=seconds)
        beside = ros.watch(JOINT_STATES, seconds=seconds).arrivals()[JOINT_STATES]
        cloud = clouds.arrivals()[CLOUD]
    rate, factor, image_rate = (Target(limit, at_least=True) for limit in (980, 0.98, 25))
    return [
        Result("camera", "joint states received", found.rate_hz, "1/s", floor.rate_hz, rate),
        Result("camera", "real-time factor", found.real_time_factor, "", floor.real_time_factor, factor),
        *(Result("camera", f"lateness p{p}", found.lateness_ms(p), "ms", floor.lateness_ms(p)) for p in (50, 99)),
        *(
            Result("camera", f"{name} images received", seen[topic].rate_hz, "1/s", images_alone, image_rate)
            for name, topic in (("colour", COLOUR), ("depth", DEPTH))
        ),
        Result("camera", "colour images beside a process of nice 19", beside_busy.rate_hz, "1/s", images_alone),
        Result("camera", "joint states beside clouds", beside.rate_hz, "1/s", floor.rate_hz, rate),
        Result("camera", "real-time factor beside clouds", beside.real_time_factor, "", floor.real_time_factor, factor),
        Result("camera", "clouds received", cloud.rate_hz, "1/s", images_alone),
        *(
            Result("camera", f"cloud, depth to message, p{p}", delays_ms[str(p)], "ms", None, Target(LONGEST_CLOUD_MS))
            for p in (50, 99)
        ),
    ]
