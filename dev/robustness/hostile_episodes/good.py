"""A valid folder of episodes, which makers modify: an arm with a mesh, a box, and a part of a killed recorder."""

from __future__ import annotations

from pathlib import Path

from worlds import FLOOR, box, write_world

from rpbi.world.loading import load_world
from rpbi_data.episodes.bags import measure_topics
from rpbi_data.episodes.files import store_files
from rpbi_data.episodes.folder import BAG, EpisodeFolder
from rpbi_data.farm.job import FarmJob
from rpbi_data.farm.policy import Policy
from rpbi_data.farm.ros.bag import EpisodeBag
from rpbi_data.farm.ros.maker import new_world
from rpbi_data.farm.run import EpisodeRun

TICKS = 60
ARM = """<robot name="arm"><link name="base"/><link name="upper"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<visual><geometry><mesh filename="meshes/part.obj"/></geometry></visual></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="9" velocity="1"/></joint></robot>"""
MESH = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n"


class _Still(Policy):
    """Sends the arm one target."""

    def act(self) -> str | None:
        if self.world.clock.tick == 5:
            self.world.put("arm/target", {"shoulder": 0.2})
        return None


def write_good(source: Path, path: Path) -> None:
    """Writes the folder.

    Args:
        source: Folder for the files of its world.
        path: The folder of episodes.
    """
    (source / "meshes").mkdir(parents=True)
    (source / "arm.urdf").write_text(ARM)
    (source / "meshes/part.obj").write_text(MESH)
    arm = {"name": "arm", "loadURDF": {"fileName": "arm.urdf", "useFixedBase": True}, "joint_state_publisher_hz": 100}
    arm["setJointMotorControlArray"] = {"controlMode": "POSITION_CONTROL"}
    main = write_world(source, collision=(FLOOR,), dynamic=(box(broadcast_hz=100),), robots=(arm,), state_hash_hz=50.0)
    folder = EpisodeFolder(path)
    world = new_world(load_world(main))
    try:
        files, _ = store_files(world.describe(), folder.files)
        episode, part = folder.begin(files=files, label="success", started="2026-01-01T00:00:00+00:00")
        with EpisodeBag(part / BAG, world) as bag:
            EpisodeRun(FarmJob(main, "", 0, TICKS, "", ""), _Still, 0, world).run(bag)
    finally:
        world.close()
    episode.state, episode.topics, episode.seconds = "complete", measure_topics(part / BAG), TICKS / 1000
    done = folder.complete(part, episode)
    _, killed = folder.begin(files=files)
    content = (done / BAG).read_bytes()
    (killed / f"{BAG}.active").write_bytes(content[: int(0.9 * len(content))])
