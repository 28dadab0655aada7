"""Reads a data set of `./rpbi export` with LeRobot's own reader, and compares every cell with the exported one.

Started by `dev/tools/lerobot/check.sh DIR`, in an environment that has LeRobot.
"""

import contextlib
import sys
from pathlib import Path

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "src/custom_ros_tools/src"))
sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "src/episodes/src"))
from rpbi_data.datasets.coarse_images import coarse, image_faults
from rpbi_data.datasets.provenance import changes, read_episode, read_export, read_images

try:
    import torchvision
except RuntimeError:  # built for another torch, without its operators; LeRobot's reader uses none of them
    for name in [name for name in sys.modules if name.startswith("torchvision")]:
        del sys.modules[name]
    operators = torch.library.Library("torchvision", "DEF")
    operators.define("nms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
    import torchvision  # noqa: F401
from lerobot.datasets.lerobot_dataset import LeRobotDataset


def main(folder: Path) -> int:
    """Prints what differs, and returns the exit code."""
    export = read_export(folder)
    backend = "pyav"
    dataset = LeRobotDataset("here/export", root=folder, video_backend=backend)
    features, cameras = export["features"], list(export["cameras"])
    rows: dict[int, dict[str, list[np.ndarray]]] = {}
    for number in range(len(dataset)):
        item = dataset[number]
        episode = rows.setdefault(int(item["episode_index"]), {})
        for key in features:
            episode.setdefault(key, []).append(np.atleast_1d(item[key].numpy()))
        for key in cameras:
            pixels = np.rint(item[key].numpy().transpose(1, 2, 0) * 255).astype(np.uint8)
            episode.setdefault(key, []).append(coarse(pixels))
    faults, cells = [], 0
    for index, columns in sorted(rows.items()):
        facts = read_episode(folder, index)
        for key in features:
            values = np.array(columns[key])
            stored = facts["columns"][key]
            cells += values.size
            if values.shape != (facts["frames"], len(stored["names"])):
                faults.append(f"episode {index}: {key}: shape {values.shape}")
            faults += [
                f"episode {index}: {key}: {each}" for each in changes(stored["names"], values, stored["checksums"])
            ]
        images = read_images(folder, index) if cameras else {}
        for key in cameras:
            found = np.array(columns[key])
            faults += [f"episode {index}: {key}: {each}" for each in image_faults(key, found, images)]
    print("\n".join(faults))
    size = f"{len(rows)} of {len(export['episodes'])} episodes, {len(dataset)} frames, {cells} cells"
    print(f"LeRobotDataset read {size}: {len(faults)} differ")
    return 1 if faults or len(rows) != len(export["episodes"]) else 0


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError):
        sys.exit(main(Path(sys.argv[1])))
