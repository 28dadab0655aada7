"""Makes point clouds of a camera of 640x480 pixels: from the depth buffer to the bytes that a socket takes."""

from __future__ import annotations

import argparse
import json
import time
from io import BytesIO

import numpy as np
from std_msgs.msg import Header

from rpbi.render.camera import Intrinsics, PointCloud, depth_in_metres
from rpbi.ros.cameras.topics import cloud_message


def main() -> None:
    """Prints percentiles of the time that one takes [ms]."""
    parser = argparse.ArgumentParser()
    parser.add_argument("seconds", type=float)
    seconds = parser.parse_args().seconds
    intrinsics = Intrinsics(near_m=0.1, far_m=10.0)
    shape = intrinsics.height_px, intrinsics.width_px
    generator = np.random.default_rng(1)
    buffer = generator.uniform(0.5, 1.0, shape).astype(np.float32)
    colour = generator.integers(0, 256, (*shape, 3), np.uint8)
    cloud = PointCloud(intrinsics)
    taken_ms = []
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        start_s = time.perf_counter()
        cloud_message(cloud.of(depth_in_metres(buffer, intrinsics), colour), Header()).serialize(BytesIO())
        taken_ms.append(1e3 * (time.perf_counter() - start_s))
    print("result:", json.dumps({p: float(np.percentile(taken_ms, p)) for p in (50, 99)}))


if __name__ == "__main__":
    main()
