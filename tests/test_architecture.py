"""The shape of the workspace: who may import what, and that every plug-in is shown, explained and tested."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from import_graph import imported_names

ROOT = Path(__file__).resolve().parent.parent
SRC = ROOT / "src"
MODULES = {
    "custom_ros_tools": "custom_ros_tools",
    "robot_model": "robot_model",
    "ros_pybullet_interface": "rpbi",
    "ik_ros": "ik_ros",
    "operator_node": "operator_node",
    "safe_robot": "safe_robot",
    "rpbi_data": "rpbi_data",
    "rpbi_utils": "rpbi_utils",
    "rpbi_ros2": "rpbi_ros2",
    "episodes": "episodes",
    "motion_primitives": "motion_primitives",
    "rpbi_mpc": "rpbi_mpc",
    "rpbi_planning": "rpbi_planning",
    "rpbi_reality": "rpbi_reality",
    "rpbi_examples": "rpbi_examples",
}
"""Python module of each package."""
ALLOWED = {
    "custom_ros_tools": set(),
    "robot_model": {"custom_ros_tools"},
    "ros_pybullet_interface": {"custom_ros_tools", "robot_model"},
    "ik_ros": {"custom_ros_tools", "robot_model", "ros_pybullet_interface"},
    "operator_node": {"custom_ros_tools", "robot_model", "ros_pybullet_interface"},
    "safe_robot": {"custom_ros_tools", "robot_model", "ros_pybullet_interface"},
    "rpbi_data": {"custom_ros_tools", "robot_model", "ros_pybullet_interface"},
    "rpbi_utils": {"custom_ros_tools", "robot_model", "ros_pybullet_interface", "rpbi_data"},
    "rpbi_ros2": {"custom_ros_tools", "ros_pybullet_interface", "rpbi_data", "rpbi_utils"},
    "motion_primitives": {"custom_ros_tools", "robot_model", "rpbi_data"},
    "rpbi_mpc": {"custom_ros_tools", "robot_model", "ros_pybullet_interface"},
    "rpbi_planning": {"custom_ros_tools", "robot_model", "ros_pybullet_interface", "ik_ros", "safe_robot"},
    "rpbi_reality": {"custom_ros_tools", "robot_model", "ros_pybullet_interface", "rpbi_data"},
    "episodes": {"custom_ros_tools", "rpbi_data"},
    "rpbi_examples": MODULES.keys() - {"rpbi_examples"},
}
"""What each package may depend on."""
FORMER_NODES = {"ik_ros": {"operator_node"}}
"""Packages whose nodes some others run under names that they had there; nothing else there imports them."""
MIDDLEWARE = re.compile(r"^(actionlib|rospy|tf2_ros|rosbag|rosgraph|roslib|genpy|\w+_msgs|\w+_srvs)$")
MESSAGES_OF_OURS = re.compile(r"^(ros_pybullet_interface|\w+\.(srv|msg))(\.|$)")


def _python_files(package: str) -> list[Path]:
    return sorted((SRC / package / "src").rglob("*.py"))


def _imports(path: Path) -> set[str]:
    """Returns the full names of all that a file imports."""
    (source,) = (each for each in path.parents if each.name == "src" and each.parent.parent == SRC)
    module = ".".join(path.relative_to(source).with_suffix("").parts).removesuffix(".__init__")
    return set(imported_names(path, module))


BY_FEATURE = {
    "ik_ros",
    "motion_primitives",
    "operator_node",
    "robot_model",
    "rpbi_data",
    "rpbi_examples",
    "rpbi_mpc",
    "rpbi_planning",
    "rpbi_reality",
    "rpbi_ros2",
    "rpbi_utils",
    "safe_robot",
}
"""Packages whose folders are features, each with its modules that need ROS, see test_layout.py."""
COMPATIBILITY = SRC / "compatibility"


def test_every_package_is_known_here():
    assert {path.parent.name for path in SRC.glob("*/package.xml")} == set(MODULES) == set(ALLOWED)


def test_packages_for_compatibility_have_no_code():
    """They are names of the release's: definitions, nodes that call what is elsewhere, and modules that import it."""
    modules = [path for path in COMPATIBILITY.rglob("src/**/*.py")]
    others = [path for path in COMPATIBILITY.rglob("*.py") if path.name != "setup.py"]
    assert others == modules
    for path in modules:
        docstring, *rest = ast.parse(path.read_text()).body
        assert isinstance(docstring, ast.Expr) and all(isinstance(node, ast.ImportFrom) for node in rest), path
    assert not {path.parent.name for path in COMPATIBILITY.glob("*/package.xml")} & set(MODULES)


@pytest.mark.parametrize("package", sorted(MODULES.keys() - BY_FEATURE))
def test_only_ros_folders_import_middleware(package):
    offenders = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in _python_files(package)
        if "ros" not in path.relative_to(SRC / package / "src").parts[1:-1]
        for name in _imports(path)
        if MIDDLEWARE.match(name.split(".")[0]) or MESSAGES_OF_OURS.match(name)
        if not _is_for_typing(path, name)
    ]
    assert offenders == []


def _is_for_typing(path: Path, name: str) -> bool:
    """Tells whether an import stands under TYPE_CHECKING only."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
            modules = [getattr(inner, "module", None) for inner in node.body]
            return any(module and f"{name}.".startswith(f"{module}.") for module in modules)
    return False


@pytest.mark.parametrize("package", MODULES)
def test_imports_between_packages_are_those_of_package_xml(package):
    package_of = {module: name for name, module in MODULES.items()} | {name: name for name in MODULES}
    imported = {
        package_of[name.split(".")[0]]
        for path in _python_files(package)
        for name in _imports(path)
        if name.split(".")[0] in package_of
    } - {package}
    tree = ElementTree.parse(SRC / package / "package.xml")
    declared = {node.text for node in tree.iter() if node.tag.endswith("depend")} & set(MODULES)
    assert imported <= ALLOWED[package]
    assert imported <= declared, "package.xml lacks a dependency"
    assert declared <= ALLOWED[package] | FORMER_NODES.get(package, set())


ROBOTS_IN_THE_SIMULATOR = ("rpbi.geometry", "rpbi.urdf", "rpbi.kinematics")
"""Robots and their geometry as PyBullet has them; everything else uses `robot_model`."""
ADAPTERS = {
    "ik_ros.solvers.pybullet_solver": "solves by the simulator's inverse kinematics",
    "safe_robot.bullet": "measures distances by PyBullet",
}
"""Modules outside of the simulator that use its robots, and what for."""


def _users_of_the_simulators_robots(imports: dict[str, set[str]]) -> list[str]:
    return [
        f"{module} imports {name}"
        for module, names in imports.items()
        for name in sorted(names)
        if _is_of_the_simulators_robots(name) and not module.startswith("rpbi.") and module not in ADAPTERS
    ]


def _is_of_the_simulators_robots(name: str) -> bool:
    return f"{name}.".startswith(tuple(f"{module}." for module in ROBOTS_IN_THE_SIMULATOR))


def _modules() -> dict[str, set[str]]:
    """Returns the full names of all that each module of the packages imports."""
    files = [(path, path.relative_to(SRC / package / "src")) for package in MODULES for path in _python_files(package)]
    return {".".join(name.with_suffix("").parts).removesuffix(".__init__"): _imports(path) for path, name in files}


def test_robots_geometry_and_urdfs_are_those_of_robot_model():
    imports = _modules()
    assert _users_of_the_simulators_robots(imports) == []
    used = {module for module, names in imports.items() if any(map(_is_of_the_simulators_robots, names))}
    assert set(ADAPTERS) <= used, "an adapter that is none any more"


def test_a_module_that_uses_the_simulators_robots_is_named():
    imports = {"safe_robot.guard": {"rpbi.geometry.Pose", "rpbi.world.World"}, "rpbi.world": {"rpbi.geometry.Pose"}}
    assert _users_of_the_simulators_robots(imports) == ["safe_robot.guard imports rpbi.geometry.Pose"]


def test_robot_model_needs_neither_ros_nor_pybullet():
    names = {name.split(".")[0] for path in _python_files("robot_model") for name in _imports(path)}
    assert not names & {"rospy", "rospkg", "pybullet", "pybullet_data", "rpbi", "ros_pybullet_interface"}


def test_only_the_world_calls_pybullet_in_the_simulator_node():
    """Rule 1: nothing in the ROS layer reaches into PyBullet, but the robot's description on request."""
    for path in (SRC / "ros_pybullet_interface/src/rpbi/ros").rglob("*.py"):
        calls = re.findall(r"\bpb\.\w+", path.read_text())
        assert path.name == "robot_info.py" or calls == [], path


FAMILIES = {
    "body": ("rpbi.bodies:BODY_TYPES", "rpbi.bodies.body:Body", "plugins.md"),
    "sensor": ("rpbi.sensors:SENSOR_TYPES", "rpbi.sensors.sensor:Sensor", "plugins.md"),
    "solver": ("ik_ros.solvers:SOLVERS", "ik_ros.solver:Solver", "ik.md"),
    "controller": (
        "rpbi.control.controllers:CONTROLLERS",
        "rpbi.control.controllers.controller:Controller",
        "controllers.md",
    ),
    "task": ("ik_ros.tasks:TASKS", "ik_ros.tasks.task:Task", "ik_tasks.md"),
    "device": ("operator_node.devices:DEVICES", "operator_node.device:Device", "devices.md"),
    "haptic device": (
        "operator_node.haptics.devices:HAPTIC_DEVICES",
        "operator_node.haptics.device:HapticDevice",
        "haptics.md",
    ),
    "mapping": ("operator_node.mappings:MAPPINGS", "operator_node.mappings.mapping:Mapping", "teleoperation.md"),
    "check": ("safe_robot.checks:CHECKS", "safe_robot.check:Check", "safety.md"),
    "primitive": ("motion_primitives.primitives:PRIMITIVES", "motion_primitives.primitive:Primitive", "learning.md"),
    "gym task": ("rpbi.gym.tasks:TASKS", "rpbi.gym.task:WorldTask", "gym.md"),
    "scene": ("rpbi_examples.scenes:SCENES", "rpbi_examples.scenes.scene:Scene", "examples.md"),
    "planner": ("rpbi_planning.planners:PLANNERS", "rpbi_planning.planner:Planner", "planning.md"),
    "format": ("rpbi_data.datasets.formats:FORMATS", "rpbi_data.datasets.format:DatasetFormat", "datasets.md"),
}
"""Table, base class and page of each family of plug-ins; their files are where the table is."""


@pytest.mark.parametrize("family", FAMILIES)
def test_every_plug_in_is_explained(family):
    table, _, page = FAMILIES[family]
    text = (ROOT / "docs" / page).read_text()
    for name in pkgutil.resolve_name(table):
        row = rf"\| \[?`{name}`(\]\((example_{name}\.md)?(#{name})?\))? \|"
        assert re.search(row, text), f"docs/{page} has no row for {family} '{name}'"


@pytest.mark.parametrize("family", FAMILIES)
def test_every_plug_in_has_a_file_and_table_entry(family):
    table, base, _ = FAMILIES[family]
    package = table.split(":")[0]
    for module in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
        importlib.import_module(module.name)
    entries = pkgutil.resolve_name(table).values()
    in_table = [pkgutil.resolve_name(entry) if isinstance(entry, str) else entry for entry in entries]
    there = {each for each in _descendants(pkgutil.resolve_name(base)) if each.__module__.startswith(f"{package}.")}
    with_parents = {parent for each in in_table for parent in each.__mro__}
    unknown = [each for each in there - with_parents if not inspect.isabstract(each)]
    assert unknown == [], "neither in the table nor a base of what is there"
    assert set(in_table) <= there
    assert len({each.__module__ for each in in_table}) == len(in_table)


def _descendants(base: type) -> set[type]:
    """Returns all classes that derive from one."""
    return {base}.union(*map(_descendants, base.__subclasses__()))


def test_solvers_and_tasks_are_imported_when_they_are_asked_for():
    program = """
import pkgutil, sys
import ik_ros.lookup, ik_ros.solvers, ik_ros.tasks
modules = [each.name for table in (ik_ros.solvers, ik_ros.tasks)
           for each in pkgutil.iter_modules(table.__path__, f"{table.__name__}.")]
assert len(modules) > 15 and not sys.modules.keys() & set(modules)
assert not sys.modules.keys() & {"PyKDL", "pytracik", "pinocchio", "daqp", "casadi"}
"""
    environment = {"PYTHONPATH": ":".join(sys.path)}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr


def test_every_solver_is_in_the_example_and_the_conformance_suite():
    from ik_ros.solvers import SOLVERS

    tests = "".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    for name in SOLVERS:
        assert (SRC / f"rpbi_examples/configs/kuka_lwr_ik_example/{name}.yaml").exists(), name
        assert f'    solver_name = "{name}"\n' in tests, f"no SolverConformance has solver '{name}'"


def test_devices_are_imported_when_they_are_asked_for():
    program = """
import sys
import operator_node.devices, operator_node.devices.device_feed
assert not sys.modules.keys() & {f"operator_node.devices.{name}" for name in operator_node.devices.DEVICES}
assert not sys.modules.keys() & {"pygame", "tkinter"}
"""
    environment = {"PYTHONPATH": ":".join(sys.path)}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr


def test_every_device_is_held_to_the_conformance_suite():
    from operator_node.devices import DEVICES

    tests = "".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    for name in DEVICES:
        assert f'    device_name = "{name}"\n' in tests, f"no DeviceConformance has device '{name}'"


def test_every_body_type_is_shown_in_an_example():
    from rpbi.bodies import BODY_TYPES
    from rpbi.world.loading import load_world

    worlds = (SRC / "rpbi_examples/configs").glob("*/config.yaml")
    shown = {each.type for world in worlds for each in load_world(str(world)).objects}
    assert shown == set(BODY_TYPES)


class KeyRecorder(dict):
    """A YAML without keys that notes which ones are looked for."""

    def __init__(self) -> None:
        self.asked: set[str] = set()

    def get(self, key, default=None):
        self.asked.add(key)
        return default


def test_every_body_type_is_tested():
    """Of types that share a section, the keys by which they are told apart must be in a test as well."""
    from rpbi.bodies import BODY_TYPES

    tests = "".join(path.read_text() for path in (ROOT / "tests").rglob("*.py") if path != Path(__file__))
    for kind, body_type in BODY_TYPES.items():
        keys = KeyRecorder()
        body_type.claims(keys)
        for key in {body_type.section, *keys.asked}:
            assert re.search(rf"\b{key}\b(=|\": )", tests), f"no test has a {kind} object: {key}"
