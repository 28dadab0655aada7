"""Rules of the layout: no import cycles, ROS only at the edge, no duplicated definitions.

Each rule is a function that names file and rule of whatever breaks it; the last tests break each rule in a copy.
"""

from __future__ import annotations

import ast
import re
import shutil
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from import_graph import ImportGraph, circles_of, needing_ros

ROOT = Path(__file__).resolve().parent.parent
MAX_SMALL = 18
MAX_SCENE_LINES = 150
MAX_WORDS = 10
SMALL_LINES = 60
TABLES = (
    "rpbi.bodies",
    "rpbi.sensors",
    "rpbi.gym.tasks",
    "ik_ros.solvers",
    "ik_ros.tasks",
    "operator_node.devices",
    "operator_node.haptics.devices",
    "operator_node.mappings",
    "safe_robot.checks",
    "rpbi_utils.controls.ros",
    "motion_primitives.primitives",
    "rpbi_utils.console",
    "rpbi_data.console",
    "rpbi_examples.console",
    "rpbi_reality.console",
    "custom_ros_tools.console",
    "rpbi_data.datasets.formats",
)
"""Packages whose classes or commands have a file each, whoever imports them."""
FLOORS = {
    "rpbi": (
        {"geometry", "linear_algebra", "plain_values", "plugins"},
        {"config", "samples"},
        {"engine", "meshes", "window"},
        {"urdf"},
        {"kinematics"},
        {"control"},
        {"sensors"},
        {"bodies"},
        {"world"},
        {"render", "replay", "reference", "follower"},
        {"images", "gym", "ros"},
        {"ros_node"},
    )
}
"""The rooms of packages from below; each imports only from floors under its own, or from rooms beside it."""
ROSPY_INTERNALS = "custom_ros_tools.ros.rospy_internals"
"""The only folder that uses private parts of rospy."""
ONE_PLACE = {
    "rospy's private parts": r"\.impl\b",
    "the XML of URDFs": r"ElementTree|\betree\b|\blxml\b",
    "class IKProblem": r"^class IKProblem\b",
    "class IKSolution": r"^class IKSolution\b",
    "class Chain": r"^class Chain\b",
    "class Waypoint": r"^class Waypoint\b",
}
"""Pattern of what stands in one library file only, or in that folder."""

SHARED_NAMES = {"Pose", "Twist"}
"""Names of classes that two packages have, with the same meaning."""


def graph_of(src: Path) -> ImportGraph:
    return ImportGraph(*sorted(src.glob("*/src")))


def circles(src: Path) -> list[str]:
    return [f"circle of imports: {', '.join(circle)}" for circle in graph_of(src).circles()]


def circles_of_rooms(src: Path) -> list[str]:
    return [
        f"circle of rooms in {package}: {', '.join(circle)}"
        for package, rooms in graph_of(src).rooms().items()
        for circle in circles_of(rooms)
    ]


def rooms_above(src: Path) -> list[str]:
    """Rooms that import from a floor above their own; a room has one line in `FLOORS`."""
    found = []
    for package, floors in FLOORS.items():
        level = {room: i for i, rooms in enumerate(floors) for room in rooms} | {"__init__": -1}
        for room, targets in graph_of(src).rooms()[package].items():
            found += [f"{package}.{each}: on no floor" for each in {room, *targets} - level.keys()]
            found += [
                f"{package}.{room} imports {each}, a floor above"
                for each in targets
                if level.get(each, -1) > level.get(room, len(floors))
            ]
    return sorted(set(found))


def small_modules(src: Path) -> list[str]:
    small = graph_of(src).small_with_one_importer(SMALL_LINES)
    small = [name for name in small if not name.startswith(tuple(f"{table}." for table in TABLES))]
    if len(small) <= MAX_SMALL:
        return []
    rule = f"at most {MAX_SMALL} modules of {SMALL_LINES} lines or less may have a single importer"
    return [f"{rule}, there are {len(small)}: {', '.join(small)}"]


def ros_in_the_core(src: Path) -> list[str]:
    """Modules outside of `ros` folders that import from one; those that interface.md documents are all they hold."""
    graph = graph_of(src)
    return [
        f"{name} imports {target}, which needs ROS"
        for name, targets in graph.imports.items()
        for target in sorted(targets)
        if ".ros." in f".{target}." and ".ros." not in f".{name}." and name not in DOCUMENTED
        if name.split(".")[0] not in BY_FEATURE
    ]


DOCUMENTED = {
    "custom_ros_tools.keyboard",
    "custom_ros_tools.robot",
    "custom_ros_tools.ros.node",
    "custom_ros_tools.ros_comm",
    "custom_ros_tools.tf",
    "operator_node.node",
    "operator_node.ros.devices.topics",
    "rpbi.ros_node",
}
"""Import paths that pages of this release or the first one name; each leads to a module elsewhere."""


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
"""Packages whose folders are features, each with all of it. Others have what needs ROS below a `ros` folder."""
EDGE = re.compile(r".*(_node|_topics|_services|_action|_messages)|.*\.(ros|console)\.\w+")
"""Modules that may need ROS: by their names, in a flat `ros` folder, and commands."""


def ros_inside(src: Path) -> list[str]:
    """Modules of these packages that need ROS, also by way of others, and are not at the edge."""
    return [
        f"{name} needs ROS: it imports {target}"
        for name, target in needing_ros(graph_of(src)).items()
        if name.split(".")[0] in BY_FEATURE and not EDGE.fullmatch(name) and name not in DOCUMENTED
    ]


FOR_ROS = re.compile(r".*(_node|_topics|_services|_action|_messages)|.*\.ros\..+")
"""Modules whose names or folders say that they need ROS."""


def without_ros_at_the_edge(src: Path) -> list[str]:
    """Modules below `ros` folders, or with names of the edge, that do not need ROS, not even by way of others."""
    graph = graph_of(src)
    modules = [name for name, path in graph.files.items() if path.name != "__init__.py" and FOR_ROS.fullmatch(name)]
    free = set(modules) - needing_ros(graph).keys() - DOCUMENTED
    return [f"{name} needs no ROS: it belongs to its feature" for name in sorted(free)]


def repeated(src: Path) -> list[str]:
    files = {name: path.read_text() for name, path in graph_of(src).files.items()}
    found = {
        what: {
            ROSPY_INTERNALS if name.startswith(f"{ROSPY_INTERNALS}.") else name
            for name, text in files.items()
            if re.search(pattern, text, re.MULTILINE)
        }
        for what, pattern in ONE_PLACE.items()
    }
    return [
        f"{what} belongs into one place, found in {sorted(names)}" for what, names in found.items() if len(names) != 1
    ]


def shared_class_names(src: Path) -> list[str]:
    homes = defaultdict(list)
    for module, path in graph_of(src).files.items():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes[node.name].append(module)
    return [
        f"class {name} is in {len(modules)} modules: {', '.join(sorted(modules))}"
        for name, modules in homes.items()
        if len(modules) > 1 and name not in SHARED_NAMES
    ]


def long_scenes(src: Path) -> list[str]:
    """Scenes that are too long to be read and copied; what several may use has files of its own, as in `parts`."""
    table = src / "rpbi_examples/src/rpbi_examples/scenes/__init__.py"
    names = (
        sorted(set(re.findall(r"rpbi_examples\.scenes\.(\w+):(?!Scene\b)", table.read_text())))
        if table.exists()
        else []
    )
    lines = {name: lines_without_docstrings((table.parent / f"{name}.py").read_text()) for name in names}
    rule = f"at most {MAX_SCENE_LINES} lines a scene without docstrings"
    return [f"{rule}, {name}.py has {count}" for name, count in sorted(lines.items()) if count > MAX_SCENE_LINES]


def lines_without_docstrings(text: str) -> int:
    """Number of lines of a module that are not in a string on its own, such as a docstring."""
    strings = (each.value for each in ast.walk(ast.parse(text)) if isinstance(each, ast.Expr))
    spans = [each for each in strings if isinstance(each, ast.Constant) and isinstance(each.value, str)]
    return len(text.splitlines()) - sum((each.end_lineno or each.lineno) - each.lineno + 1 for each in spans)


def names_of_tests(tree: ast.Module) -> list[str]:
    """Names of tests and their classes, and the literal ids of their parameters, as words."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            found.append(node.name.removeprefix("test_").replace("_", " "))
        elif isinstance(node, ast.ClassDef) and node.name.startswith("Test"):
            found.append(re.sub("(?<!^)(?=[A-Z])", " ", node.name.removeprefix("Test")).lower())
        elif isinstance(node, ast.keyword) and node.arg in ("id", "ids"):
            literals = (each.value for each in ast.walk(node.value) if isinstance(each, ast.Constant))
            found += [each for each in literals if isinstance(each, str)]
    return found


def wordy_test_names(src: Path) -> list[str]:
    """Files with names of tests that are too long to be read at once, or have "what" as their subject."""
    tests = [*src.parent.glob("tests/**/*.py"), *src.glob("*/src/*/conformance.py")]
    rule = f"at most {MAX_WORDS} words and no 'what' in the name of a test"
    found = {path: names_of_tests(ast.parse(path.read_text())) for path in sorted(tests)}
    wordy = {
        path: [name for name in names if len(name.split()) > MAX_WORDS or "what" in name.split()]
        for path, names in found.items()
    }
    return [f"{path.relative_to(src.parent)}: {rule}: {', '.join(names)}" for path, names in wordy.items() if names]


def mutants_without_a_test(src: Path) -> list[str]:
    """Changes of the guard whose test was removed or renamed, so that nothing can catch them."""
    tests = [*src.parent.glob("tests/*/safe_robot/*.py"), *src.glob("safe_robot/src/*/conformance.py")]
    there = " ".join(path.read_text() for path in tests)
    return [
        f"{path.relative_to(src.parent)}: no test is named {name}"
        for path in src.parent.glob("dev/robustness/mutants/*.yaml")
        for name in sorted({name for each in yaml.safe_load(path.read_text()) for name in each["test"].split(" or ")})
        if name not in there
    ]


RULES: tuple[Callable[[Path], list[str]], ...] = (
    circles,
    circles_of_rooms,
    rooms_above,
    small_modules,
    ros_in_the_core,
    ros_inside,
    without_ros_at_the_edge,
    repeated,
    shared_class_names,
    long_scenes,
    wordy_test_names,
    mutants_without_a_test,
)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_layout_keeps(rule):
    assert rule(ROOT / "src") == []


RPBI = "ros_pybullet_interface/src/rpbi"
ROOT_OF_BREAKS = "../../../.."
DATA = "../../../rpbi_data/src/rpbi_data"
SCENES = "../../../rpbi_examples/src/rpbi_examples/scenes"
BREAKS = {
    circles: (
        {"engine/clock.py": "from .mailbox import Mailbox", "engine/mailbox.py": "from .clock import Clock"},
        "engine.clock",
    ),
    circles_of_rooms: (
        {"engine/clock.py": "import rpbi.meshes.checks", "meshes/checks.py": "import rpbi.engine.mailbox"},
        "rpbi: engine, meshes",
    ),
    rooms_above: ({"sensors/more.py": "import rpbi.world.loading"}, "rpbi.sensors imports world"),
    small_modules: (
        {f"replay/part_{i}.py": "" for i in range(26)}
        | {"replay/session.py": "\n".join(f"import rpbi.replay.part_{i}" for i in range(26))},
        "rpbi.replay.part_0",
    ),
    ros_in_the_core: ({"engine/pacer.py": "def late():\n    from rpbi.ros.node import main"}, "rpbi.engine.pacer"),
    ros_inside: (
        {f"{DATA}/labels/dataset.py": "def late():\n    from rpbi_data.bags.recorded_topics import Recorder"},
        "rpbi_data.labels.dataset needs ROS: it imports rpbi_data.bags.recorded_topics",
    ),
    without_ros_at_the_edge: ({"ros/pace.py": "import rpbi.engine.pacer"}, "rpbi.ros.pace needs no ROS"),
    repeated: ({"engine/pacer.py": "import xml.etree.ElementTree"}, "rpbi.engine.pacer"),
    shared_class_names: ({"engine/pacer.py": "class Mailbox:\n    pass"}, "rpbi.engine.pacer"),
    long_scenes: (
        {f"{SCENES}/__init__.py": "'rpbi_examples.scenes.new:New'", f"{SCENES}/new.py": "\n" * MAX_SCENE_LINES},
        f"new.py has {MAX_SCENE_LINES + 2}",
    ),
    wordy_test_names: (
        {
            f"{ROOT_OF_BREAKS}/tests/test_new.py": "def test_a_b_c_d_e_f_g_h_i_j_k(): ...\n"
            "def test_a_b_c_d_e_f_g_h_i_j(): ...\ndef test_what(): ...\nclass TestWhat: ...\nf(ids=['what', 'l'])"
        },
        "in the name of a test: a b c d e f g h i j k, what, what, what",
    ),
    mutants_without_a_test: (
        {f"{ROOT_OF_BREAKS}/dev/robustness/mutants/new.yaml": "[{test: lost}]"},
        "new.yaml: no test is named lost",
    ),
}
"""What to add to which files, so that a rule is broken; and what the message names."""


@pytest.mark.thorough
@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_broken_rule_is_reported_with_its_file(rule, tmp_path):
    src = tmp_path / "src"
    for package in ("custom_ros_tools", "robot_model", "ros_pybullet_interface", "rpbi_data", "ik_ros"):
        others = shutil.ignore_patterns("__pycache__")  # whose files come and go while other tests run
        shutil.copytree(ROOT / "src" / package / "src", src / package / "src", ignore=others)
    additions, named = BREAKS[rule]
    for name, text in additions.items():
        path = (src / RPBI / name).resolve()
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "a") as file:
            file.write(f"\n{text}\n")
    told = rule(src)
    assert len(told) == 1 and named in told[0], told


def test_imports_for_typing_and_inside_functions_count(tmp_path):
    (tmp_path / "a.py").write_text("from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from b import x\n")
    (tmp_path / "b.py").write_text("def late():\n    import a\n")
    assert ImportGraph(tmp_path).circles() == [["a", "b"]]
