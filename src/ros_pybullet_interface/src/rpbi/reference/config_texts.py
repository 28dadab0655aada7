"""Names, titles and fixed texts of the reference pages of YAML files, which `config_page` generates."""

from rpbi.world.schemas import WORLD

INTRODUCTION = """\
Every YAML file of a world and every key in it, with one page for each kind of file. For how to write worlds see
[worlds.md](worlds.md), for their topics and services [topics_and_services.md](topics_and_services.md).

```shell
./rpbi check WORLD.yaml                  # all problems of a world at once, each with file, key and expected value
```

- Keys that are not listed on these pages are errors.
- A key may be left out unless it is required. Where the default is empty, the meaning says which value is used, or
  PyBullet's own default is used.
- camelCase keys are arguments of the PyBullet function of the same name.
- Constants are given by name or by PyBullet's number. 1 and 0 are accepted for true and false, and whole numbers
  wherever a number is expected. YAML reads `1e-3` as text: write `1.0e-3`.
- An entry of a list of files is a file name, or a mapping with `file` and the keys that differ. `null` removes a
  key of the file, such as `controllers: null`.
- Files are looked up in the folder of the file that names them, in `setAdditionalSearchPath` and in PyBullet's data;
  `{package}/path` and `package://package/path` work everywhere.
- Editors complete, explain and check these keys, see [worlds.md](worlds.md#in-an-editor)."""
OVERVIEW, OBJECTS, COMMON, NODES = "config_reference.md", "config_objects.md", "config_common.md", "config_nodes.md"
PAGES = {WORLD: "config_world.md", "robot": "config_robot.md", "rgbd_sensor": "config_sensors.md"}
"""Page of some kinds of files, keyed by kind; all other kinds are on the page `OBJECTS`."""
SHARED = {"contacts": "config_sensors.md", "sensors": "config_sensors.md"}
"""Page of some mappings that several kinds of files have, keyed by heading; all others are on the page `COMMON`."""
BEGINNINGS = {
    "config_world.md": (
        "YAML reference: the world",
        "The main file of a world names its objects, robots and cameras, and sets physics and time. Here are an "
        "example and every key.",
    ),
    "config_robot.md": (
        "YAML reference: robots",
        "A robot's file names its URDF, its motors, controllers and sensors. Here are an example and every key.",
    ),
    OBJECTS: (
        "YAML reference: objects",
        "Objects without motors have a file each: visible, colliding, moved by physics, from a URDF, or soft. Here are "
        "an example and every key of each kind.",
    ),
    "config_sensors.md": (
        "YAML reference: cameras and other sensors",
        "A camera has a file of its own. Contacts and sensors of your own types are keys of a body's file. Here are an "
        "example and every key.",
    ),
    COMMON: (
        "YAML reference: common mappings and constants",
        "These mappings occur in several kinds of files: shapes, dynamics, URDFs, frames. The names of PyBullet's "
        "constants follow.",
    ),
    NODES: (
        "YAML reference: nodes",
        "This page lists the keys of three nodes of [custom_ros_tools.md](custom_ros_tools.md) that read a YAML file "
        "as their parameter `~config`. The pages of other nodes explain their keys: "
        "[motion_planner](planning.md#configuration), [tracked_object](tracking.md#from-a-tracking-system-to-tf), "
        "[apriltag](tracking.md#apriltags-in-images), [primitives](learning.md), [guard](safety.md), "
        "[stand_in](real_robots.md#the-stand-in) and [ik_setup](ik.md).",
    ),
}
"""Title and first paragraph of each page, keyed by page, in the order of the overview."""
NODES_EXAMPLE = """\
<node pkg="custom_ros_tools" type="remap_joint_state_to_floatarray" name="remap">
  <rosparam param="config" command="load" file="remap.yaml"/>
</node>"""
GUIDES = {
    "world": "worlds.md",
    "robot": "robots.md",
    "urdf": "worlds.md",
    "soft_object": "soft_bodies.md",
    "object": "extending.md",
    "rgbd_sensor": "cameras.md",
    "configureDebugVisualizer": "windows.md",
    "resetDebugVisualizerCamera": "windows.md",
    "planar_base": "bases.md",
    "enabled_joint_force_torque_sensors": "force_torque.md",
    "joint_trajectory_controller": "trajectories.md",
    "contacts": "contacts.md",
    "attachments": "hands.md",
    "coupled_joints": "hands.md",
    "changeDynamics": "dynamics.md",
    "sensors": "extending.md",
}
"""Page that explains the keys under a heading of the reference pages, keyed by heading."""
