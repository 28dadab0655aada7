"""Reads a data set of `./rpbi export` by robomimic's published layout, and compares every cell with the exported one.

Started by `dev/tools/robomimic/check.sh DIR`.
"""

import json
import sys
from pathlib import Path

import h5py
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "src/custom_ros_tools/src"))
sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "src/episodes/src"))
from rpbi_data.datasets.provenance import changes, frame_changes, frame_checksums, read_episode, read_export


def main(folder: Path) -> int:
    """Prints what differs, and returns the exit code."""
    faults, cells = [], 0
    with h5py.File(folder / "dataset.hdf5") as file:
        data = file["data"]
        json.loads(data.attrs["env_args"])
        low, high = file["action_scaling/low"][:], file["action_scaling/high"][:]
        demos = [data[f"demo_{index}"] for index in range(len(data))]
        for index, demo in enumerate(demos):
            facts = read_episode(folder, index)
            count = facts["frames"]
            found = {f"obs/{name}": values[:] for name, values in demo["obs"].items()}
            found |= {f"next_obs/{name}": values[:] for name, values in demo["next_obs"].items()}
            found |= {name: demo[name][:] for name in ("actions", "rewards", "dones")}
            cells += sum(values.size for values in found.values())
            told = [f"{name}: {len(values)} rows" for name, values in found.items() if len(values) != count]
            for key, stored in facts["columns"].items():
                told += [f"{key}: {each}" for each in changes(stored["names"], found[_path(key)], stored["checksums"])]
            for key, stored in facts["frame_checksums"].items():
                told += [f"{key}: {each}" for each in frame_changes(frame_checksums(found[_path(key)]), stored)]
            for name, values in demo["obs"].items():
                if not np.array_equal(found[f"next_obs/{name}"], np.concatenate([values[1:], values[-1:]])):
                    told.append(f"next_obs/{name}: not the next of obs/{name}")
            robot = low + (found["actions"] + 1) / 2 * (high - low)
            if not np.isfinite(robot).all() or demo.attrs["num_samples"] != count or found["dones"].sum() != 1:
                told.append("actions, num_samples or dones are wrong")
            faults += [f"demo_{index}: {each}" for each in told]
        total = sum(demo.attrs["num_samples"] for demo in demos)
        if data.attrs["total"] != total:
            faults.append(f"total: {data.attrs['total']} instead of {total}")
    print("\n".join(faults))
    episodes = len(read_export(folder)["episodes"])
    print(f"h5py read {len(demos)} of {episodes} episodes, {total} frames, {cells} cells: {len(faults)} differ")
    return 1 if faults or len(demos) != episodes else 0


def _path(key: str) -> str:
    return f"obs/{key.removeprefix('observation.').replace('.', '_')}"


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
