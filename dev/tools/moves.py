"""Moves modules to their new packages and rewrites all that names them; deleted when the moves are done.

    python3 dev/tools/moves.py

Can be run again: after an interruption, and on a tree in which others have used old names meanwhile. A module that is
at its new place already is not moved again: what is at its old path then is a thin module that stays.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE_OF = {"rpbi": "ros_pybullet_interface"}
"""Packages whose Python module has another name."""

MODULES = {
    "rpbi_utils.bags": "rpbi_data.bags",
    "rpbi_utils.ros.bags": "rpbi_data.bags",
    "rpbi_utils.ros.bags.bag_to_table": "rpbi_data.bags.bag_to_table_node",
    "rpbi_utils.ros.bags.bag_writer": "rpbi_data.bags.bag_writer_node",
    "rpbi_utils.ros.bags.connections": "rpbi_data.bags.connected_topics",
    "rpbi_utils.ros.bags.images": "rpbi_data.bags.image_files",
    "rpbi_utils.ros.bags.recorder": "rpbi_data.bags.recorded_topics",
    "rpbi_utils.ros.replay.recorded_session": "rpbi_data.replay.session_messages",
    "rpbi_utils.ros.console.plot": "rpbi_data.console.plot",
    "rpbi_utils.ros.console.replay": "rpbi_data.console.replay",
    "rpbi_utils.labelled_images": "rpbi_data.labels",
    "episodes.config": "rpbi_data.episodes.config",
    "episodes.errors": "rpbi_data.episodes.errors",
    "episodes.facts": "rpbi_data.episodes.facts",
    "episodes.files": "rpbi_data.episodes.files",
    "episodes.folder": "rpbi_data.episodes.folder",
    "episodes.listing": "rpbi_data.episodes.listing",
    "episodes.ros.bags": "rpbi_data.episodes.bags",
    "episodes.ros.comparison": "rpbi_data.episodes.compared_messages",
    "episodes.ros.sample_messages": "rpbi_data.episodes.sample_messages",
    "episodes.ros.record": "rpbi_data.episodes.record_node",
    "episodes.ros.verification": "rpbi_data.episodes.verified_messages",
    "episodes.datasets": "rpbi_data.datasets",
    "episodes.ros.export": "rpbi_data.datasets",
    "episodes.ros.export.folder": "rpbi_data.datasets.export",
    "episodes.view": "rpbi_data.view",
    "episodes.ros.view": "rpbi_data.view.bag_messages",
    "episodes.farm": "rpbi_data.farm",
    "episodes.ros.farm": "rpbi_data.farm.ros",
    "episodes.ros.console": "rpbi_data.console",
    "episodes.ros.console.restore": "rpbi_utils.console.restore",
    "episodes.ros.console.save": "rpbi_utils.console.save",
    "rpbi_utils.ros.console": "rpbi_utils.console",
    "rpbi_utils.ros.controls": "rpbi_utils.controls.ros",
    "rpbi_utils.ros.controls.panels": "rpbi_utils.controls.ros",
    "rpbi_utils.ros.controls.panels.view": "rpbi_utils.controls.view",
    "rpbi_utils.ros.controls.requests": "rpbi_utils.controls.requests",
    "rpbi_utils.ros.fake_driver.node": "rpbi_utils.fake_driver.stand_in_node",
    "rpbi_utils.ros.interpolation": "rpbi_utils.interpolation.interpolation_node",
    "rpbi_utils.ros.live_plot.node": "rpbi_utils.live_plot.live_plot_node",
    "rpbi_utils.ros.live_plot.source": "rpbi_utils.live_plot.source_topics",
    "rpbi_utils.ros.live_plot.window": "rpbi_utils.live_plot.window",
    "rpbi_utils.ros.plain_text": "rpbi_utils.plain_text",
    "rpbi_utils.ros.windows": "rpbi_utils.windows",
    "rpbi_utils.ros.tracking.april_tags": "rpbi_utils.tracking.april_tags_node",
    "rpbi_utils.ros.tracking.tracked_object": "rpbi_utils.tracking.tracked_object_node",
    "rpbi_utils.ros.wrenches": "rpbi_utils.wrenches.calibrate_wrench_node",
}
"""New name by old name of modules, and of packages with all below them; the longest name counts."""
DOORS = {"rpbi_utils": "rpbi_data", "episodes": "rpbi_data"}
"""Packages whose names of `__all__` can be imported from another one."""
DOCSTRINGS = {
    "rpbi_data.episodes": "Demonstrations as episodes: recorded, listed, read as one table, and verified.",
    "rpbi_data.replay": "Recorded sessions in bags.",
    "rpbi_data.console": "Commands for bags, episodes and data sets.",
    "rpbi_utils.controls": "The window for the running world.",
    "rpbi_data.farm.ros": "The processes of a farm, which write bags.",
}
"""Docstrings of new packages."""
FILES = {
    "tests/unit/episodes/test_coarse_images.py": "tests/unit/rpbi_data/datasets/test_coarse_images.py",
    "tests/unit/episodes/test_foreign_files.py": "tests/unit/rpbi_data/datasets/test_foreign_files.py",
    "tests/unit/episodes/test_page.py": "tests/unit/rpbi_data/view/test_page.py",
    "tests/unit/episodes": "tests/unit/rpbi_data/episodes",
    "tests/unit/rpbi_utils/conftest.py": "tests/unit/conftest.py",
    **{
        f"tests/unit/rpbi_utils/test_{name}.py": f"tests/unit/rpbi_data/bags/test_{name}.py"
        for name in (
            *("frame_tables", "layout", "limits", "message_type", "plots", "resampling", "row_plan"),
            *("tables", "tables_to_files"),
        )
    },
    "tests/ros/episodes": "tests/ros/rpbi_data/episodes",
    "tests/ros/rpbi_utils/conftest.py": "tests/ros/rpbi_data/bags/conftest.py",
    **{
        f"tests/ros/rpbi_utils/test_{name}.py": f"tests/ros/rpbi_data/bags/test_{name}.py"
        for name in (
            *("bag_images", "bag_reader", "bag_to_table", "bags", "data_page", "hostile_bags", "recorder"),
            *("replay", "topic_report"),
        )
    },
}
"""New path by old path of other files and folders; the longest path counts."""
TEXTS = ("src", "docs", "tests", "benchmarks", "robustness", "dev", "tools", "templates", "docker", "README.md", "rpbi")
UNTOUCHED = (
    "dev/tools/moves.py",
    "tests/sim/rpbi_data/test_old_names.py",
    "tests/sim/rpbi_data/recorded/old_policy.py",
)
"""Files that name old paths on purpose."""


def new_name(name: str) -> str:
    """Returns the full name that a module, or something in it, has after the moves."""
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        if (old := ".".join(parts[:end])) in MODULES:
            return ".".join([MODULES[old], *parts[end:]])
    return name


def source_of(module: str) -> Path:
    """Returns the path of a module without its suffix."""
    top = module.split(".")[0]
    return ROOT / "src" / PACKAGE_OF.get(top, top) / "src" / module.replace(".", "/")


def module_of(path: Path) -> str:
    """Returns the full name of a module of `src`, or the empty text."""
    match = re.fullmatch(r"src/\w+/src/(\w[\w/]*)\.py", path.relative_to(ROOT).as_posix())
    return match[1].replace("/", ".").removesuffix(".__init__") if match else ""


def git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout


def tracked() -> list[Path]:
    return [path for name in git("ls-files").splitlines() if (path := ROOT / name).is_file()]


def move(old: Path, new: Path) -> bool:
    """Moves a file unless there is one."""
    if new.exists():
        return False
    new.parent.mkdir(parents=True, exist_ok=True)
    git("mv", str(old), str(new))
    return True


def move_modules() -> None:
    """Moves modules, whose relative imports become absolute ones of the old names before."""
    modules = {path: module for path in tracked() if (module := module_of(path)) and new_name(module) != module}
    for old, module in modules.items():
        if not place_of(old, module).exists():
            old.write_text(with_absolute_imports(old.read_text(), module, old.name == "__init__.py"))
    for old, module in modules.items():
        is_package = old.name == "__init__.py"
        if not move(old, place_of(old, module)) and is_package and not list(old.parent.rglob("[!_]*.py")):
            git("rm", "-qf", str(old))
    for name, docstring in DOCSTRINGS.items():
        path = source_of(name) / "__init__.py"
        if source_of(name).is_dir() and len(path.read_text().splitlines() if path.exists() else ()) < 2:
            path.write_text(f'"""{docstring}"""\n')
            git("add", str(path))


def place_of(old: Path, module: str) -> Path:
    new = source_of(new_name(module))
    return new / "__init__.py" if old.name == "__init__.py" else new.with_suffix(".py")


def move_files() -> None:
    for old in tracked():
        name = old.relative_to(ROOT).as_posix()
        if (new := new_path(name)) != name and move(old, ROOT / new) and old.suffix == ".py":
            up = new.count("/") - name.count("/")
            text = (ROOT / new).read_text()
            for depth in re.findall(r"__file__\).*?parents\[(\d)\]", text)[:1]:
                text = text.replace(f"parents[{depth}]", f"parents[{int(depth) + up}]")
            (ROOT / new).write_text(text)


def new_path(name: str) -> str:
    parts = name.split("/")
    for end in range(len(parts), 0, -1):
        if (old := "/".join(parts[:end])) in FILES:
            return "/".join([FILES[old], *parts[end:]])
    return name


def is_module(name: str) -> bool:
    """Tells whether a new name is that of a module."""
    return source_of(name).with_suffix(".py").exists() or (source_of(name) / "__init__.py").exists()


def with_absolute_imports(text: str, module: str, is_package: bool) -> str:
    """Returns a Python file without relative imports."""

    def change(node: ast.ImportFrom) -> dict[str, list[str]] | None:
        if not node.level:
            return None
        return {source_named(node, module, is_package): [_named(alias.name, alias.asname) for alias in node.names]}

    return _with_changed_imports(text, change)


def with_imports(text: str, module: str, is_package: bool) -> str:
    """Returns a Python file with imports of new names.

    Args:
        text: The file.
        module: Full name of its module; empty outside of `src`.
        is_package: Whether it is an `__init__.py`.
    """
    home = module if is_package else module.rpartition(".")[0]

    def change(node: ast.ImportFrom) -> dict[str, list[str]] | None:
        if node.level and not module:
            return None
        source = source_named(node, module, is_package)
        found: dict[str, list[str]] = {}
        for alias in node.names:
            target, name = _import_of(source, alias.name)
            renamed = alias.asname or (alias.name if name != alias.name else None)
            found.setdefault(_as_seen_from(home, target), []).append(_named(name, renamed))
        before = {"." * node.level + (node.module or ""): [_named(each.name, each.asname) for each in node.names]}
        is_moved = any(_import_of(source, each.name) != (source, each.name) for each in node.names)
        is_ours = any(f"{module}.".startswith(f"{each}.") for each in MODULES.values())
        return found if found != before and (is_moved or is_ours and not node.level) else None

    return _with_changed_imports(text, change)


def source_named(node: ast.ImportFrom, module: str, is_package: bool) -> str:
    """Returns the full name of that from which a statement imports."""
    parts = module.split(".") if is_package else module.split(".")[:-1]
    outer = parts[: len(parts) - node.level + 1] if node.level else []
    return ".".join([*outer, *filter(None, [node.module])])


def _named(name: str, other: str | None) -> str:
    return f"{name} as {other}" if other else name


def _with_changed_imports(text: str, change: Callable[[ast.ImportFrom], dict[str, list[str]] | None]) -> str:
    lines = text.splitlines(keepends=True)
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)]
    for node in sorted(nodes, key=lambda node: -node.lineno):
        if changed := change(node):
            start, indent = node.lineno - 1, " " * node.col_offset
            comment = re.search(r"  #.*$", lines[start].rstrip("\n"))
            lines[start : node.end_lineno] = [
                f"{indent}from {where} import {', '.join(names)}{comment[0] if comment else ''}\n"
                for where, names in changed.items()
            ]
    return "".join(lines)


def _import_of(source: str, name: str) -> tuple[str, str]:
    """Returns from where a name is imported after the moves, and its name there."""
    full = f"{source}.{name}"
    if source in DOORS and not is_module(new_name(full)):
        return DOORS[source], name
    new = new_name(full)
    target, _, last = new.rpartition(".")
    if new != full and full not in MODULES and new_name(source) != target:
        return new_name(source), name
    return target, last


def _as_seen_from(home: str, target: str) -> str:
    """Returns how a file of a package names a module: siblings relatively."""
    if home and target == home:
        return "."
    if home and target.rpartition(".")[0] == home:
        return f".{target.rpartition('.')[2]}"
    return target


DOTTED = re.compile(r"(?<![\w./-])(?:rpbi_utils|episodes)(?:\.[a-z_]\w*)+")
SLASHED = re.compile(r"(?<![\w./-])(src/)?(?:(?:rpbi_utils|episodes)/src/)?((?:rpbi_utils|episodes)(?:/[a-z_]\w*)+)")


def with_names(text: str) -> str:
    """Returns any text with new names and paths."""

    def dotted(match: re.Match[str]) -> str:
        return new_name(match[0])

    def slashed(match: re.Match[str]) -> str:
        old = match[2].replace("/", ".")
        if (new := new_name(old)) == old:
            return match[0]
        top = new.split(".")[0]
        has_source = match[0] != (match[1] or "") + match[2]
        return f"{match[1] or ''}{f'{top}/src/' if has_source else ''}{new.replace('.', '/')}"

    text = SLASHED.sub(slashed, DOTTED.sub(dotted, text))
    for old, new in sorted(FILES.items(), key=lambda item: -len(item[0])):
        text = re.sub(rf"(?<![\w/]){re.escape(old)}(?![\w])", new, text)
    return re.sub(r"^(\s*)from (rpbi_utils|episodes) import (?!schemas)", r"\1from rpbi_data import ", text, flags=re.M)


def rewrite() -> None:
    for path in tracked():
        name = path.relative_to(ROOT).as_posix()
        if not name.startswith(TEXTS) or name in UNTOUCHED or path.is_symlink() or is_thin(path):
            continue
        try:
            text = path.read_text()
        except UnicodeDecodeError:
            continue
        new = text
        if path.suffix == ".py":
            module = module_of(path)
            new = with_imports(new, module, path.name == "__init__.py")
        new = with_names(new)
        if new != text:
            path.write_text(new)


def is_thin(path: Path) -> bool:
    """Tells whether a module is at an old path that stays."""
    module = module_of(path)
    return bool(module) and (new_name(module) != module or module in DOORS)


def main() -> None:
    move_modules()
    move_files()
    rewrite()
    git("add", "-A", "src", "tests", "docs")
    python = [str(path) for path in tracked() if path.suffix == ".py"]
    for words in (["check", "--select", "I", "--fix", "-q"], ["format", "-q"]):
        subprocess.run([sys.executable, "-m", "ruff", *words, "--no-cache", *python], cwd=ROOT, check=True)


if __name__ == "__main__":
    main()
