"""Builds the reference page of all topics, services, frames and parameters of the simulator."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from rpbi.bodies import BODY_TYPES
from rpbi.reference.markdown import WRITTEN_BY, block, code, link, page, table
from rpbi.reference.reference_world import CONTROLLERS, JOINT, reference_world
from rpbi.world import World

from .headers import FRAMES
from .interface_table import (
    OF_WINDOW,
    PARAMETERS,
    PUBLISHES,
    SERVES,
    SUBSCRIBES,
    Endpoint,
    endpoints,
    of_body,
    of_camera,
)

INTRODUCTION = """\
Topics, services and parameters of the node `ros_pybullet_interface_node.py`. `./rpbi check WORLD.yaml` lists the same
for your own world.

- `NAME` stands for the name of an object, `JOINT` for that of a joint, `LINK` for that of a link, `CONTROLLER` for
  that of a [controller](controllers.md) in a robot's YAML.
- Names without `/` in front are relative: they are resolved in the namespace of the node.
- All messages of one tick have the stamp of this tick. Rates are in simulated time, unless wall time is stated.
- Keys such as `broadcast_hz` set the rate of a topic or enable the topic, see [the reference](config_reference.md).
- A message that has NaN, an unknown joint or the wrong number of values changes nothing and is logged. A
  service that refuses a request answers `success: false` and the reason."""
WINDOW = """\
With `connection_mode: GUI`, see [windows.md](windows.md#pybullets-own-window). Without a window nothing is published,
and changes of the view are refused."""
OBJECTS = """\
The column *of* names types of objects, see [concepts.md](concepts.md#bodies-and-sensors). Your own
objects and sensors also have the topics and services that their classes declare, see [extending.md](extending.md)."""
CAMERAS = """\
`camera` is the first camera, whatever its name; further ones have `rpbi/NAME/...`. A separate node publishes them,
with the name of the simulator and `_camera`. Images without subscribers are not drawn. The rate is `hz` of the
camera, see [cameras.md](cameras.md)."""
FOLLOWED = """\
If the main file sets `tf_prefix`, these frames and those under `poses` have that prefix. The node listens to TF for
frames that `object_tf` names, which a body or camera follows."""
OTHERS = """\
The nodes of custom_ros_tools, which remap joint states and publish transforms and markers, are in
[custom_ros_tools.md](custom_ros_tools.md#nodes). The commands of rpbi_utils have no topics of their own, see
[replay_and_fork.md](replay_and_fork.md) and [data.md](data.md). Its nodes are in [interpolation.md](interpolation.md),
[force_torque.md](force_torque.md#a-zero-and-the-weight-of-a-payload), [tracking.md](tracking.md) and
[real_robots.md](real_robots.md#the-stand-in)."""
HEADINGS = {PUBLISHES: "Published", SUBSCRIBES: "Subscribed", SERVES: "Services"}
PACKAGES = ("ros_pybullet_interface", "compatibility/cob_srvs", "compatibility/custom_srvs")
"""Folders of the packages that define the node's own message and service types."""


def interface_files(root: Path) -> dict[Path, str]:
    """Returns a mapping from the reference page's path to its text; `root` is the workspace folder."""
    world = reference_world()
    try:
        return {root / "docs/topics_and_services.md": interface_page(world, _definitions(root))}
    finally:
        world.close()


def interface_page(world: World, definitions: Mapping[str, str]) -> str:
    """Returns the text of the reference page, in Markdown.

    Args:
        world: A world that has a body of each type, with the type as its name, and a camera.
        definitions: Definitions of this workspace's message and service types, indexed by names such as
            `ros_pybullet_interface/Contacts`.
    """
    of_bodies = {name: list(of_body(world, name, body)) for name, body in world.bodies.items()}
    of_cameras = [each for name in world.cameras for each in of_camera(world, name)]
    listed = {each for rows in (*of_bodies.values(), of_cameras) for each in rows}
    rest = [each for each in endpoints(world) if each not in listed]
    of_node = {each: [""] for each in rest if each.note != OF_WINDOW}
    of_window = {each: [""] for each in rest if each.note == OF_WINDOW}
    parts = [WRITTEN_BY, "# Topics and services", INTRODUCTION]
    parts += ["## Simulator", *_tables(of_node, definitions)]
    parts += ["## Objects", OBJECTS, *_tables(_owners(of_bodies), definitions)]
    parts += ["## Cameras", CAMERAS, *_tables({each: [""] for each in of_cameras}, definitions)]
    parts += ["## PyBullet's window", WINDOW, *_tables(of_window, definitions)]
    parts += ["## Frames", table(("frame", "meaning"), ((code(name), text) for name, text in FRAMES.items())), FOLLOWED]
    parts += ["## Parameters", _parameters(), "## Other nodes", OTHERS, "## Message and service definitions"]
    for name, text in definitions.items():
        parts += [f"### {_short(name)}", block("text", text)]
    return page(parts)


def _owners(of_bodies: Mapping[str, Iterable[Endpoint]]) -> dict[Endpoint, list[str]]:
    """Returns the types of bodies that have a topic or service, indexed by topic or service.

    In the returned topics and services, placeholders such as NAME replace the example names of the reference world.

    Args:
        of_bodies: Topics and services of the reference world's bodies, indexed by the type of body.
    """
    owners: dict[Endpoint, list[str]] = {}
    placeholders = {f"/{JOINT}/": "/JOINT/", **{f"/{name}/": "/CONTROLLER/" for name in CONTROLLERS}}
    for body, rows in of_bodies.items():
        for row in rows:
            name = row.name.replace(f"rpbi/{body}/", "rpbi/NAME/")
            for example, placeholder in placeholders.items():
                name = name.replace(example, placeholder)
            kinds = owners.setdefault(Endpoint(row.kind, name, row.type, "", row.meaning), [])
            if body not in kinds:
                kinds.append(body)
    return owners


def _tables(owners: Mapping[Endpoint, list[str]], definitions: Mapping[str, str]) -> Iterator[str]:
    """Yields a heading and a table for each kind of endpoint; kinds without endpoints are left out.

    Args:
        owners: Types of bodies that have an endpoint, indexed by endpoint. For an endpoint without a body, `[""]`.
        definitions: Definitions of this workspace's message and service types, indexed by name.
    """
    for kind, heading in HEADINGS.items():
        rows = {row: kinds for row, kinds in owners.items() if row.kind == kind}
        if not rows:
            continue
        yield f"**{heading}**"
        head = ("name", "type", "meaning")
        if any(kinds != [""] for kinds in rows.values()):
            yield table((*head, "of"), ((*_cells(row, definitions), _names(kinds)) for row, kinds in rows.items()))
        else:
            yield table(head, (_cells(row, definitions) for row in rows))


def _cells(row: Endpoint, definitions: Mapping[str, str]) -> tuple[str, str, str]:
    kind = link(_short(row.type), words=row.type) if row.type in definitions else row.type
    return code(row.name), kind, row.meaning


def _short(kind: str) -> str:
    """Returns the heading of a type: its name, with the package if that is another one."""
    return kind.removeprefix("ros_pybullet_interface/")


def _names(kinds: list[str]) -> str:
    return "all" if kinds == list(BODY_TYPES) else ", ".join(kinds)


def _parameters() -> str:
    rows = ((code(each.name), "set" if each.is_set else "read", each.meaning) for each in PARAMETERS)
    return table(("name", "", "meaning"), rows)


def _definitions(root: Path) -> dict[str, str]:
    files = [path for package in PACKAGES for path in sorted((root / "src" / package).glob("[ms][sr][gv]/*"))]
    return {f"{path.parent.parent.name}/{path.stem}": path.read_text() for path in files}
