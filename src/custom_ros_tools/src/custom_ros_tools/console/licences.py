"""The command `licences`: the licences of all parts, from the files of each part."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from importlib import metadata
from pathlib import Path

from catkin_pkg.package import parse_package

from .modules import workspace

MAX_SHOWN = 5
"""Number of licences that are named for one part; further ones are counted."""
UNKNOWN = "not stated"
DEBIAN_DOCS = Path("/usr/share/doc")
LICENCE_FILE = re.compile(r"(licen[cs]e|copying)(\.\w+)?", re.IGNORECASE)
REQUIREMENT = re.compile(r"^\s*([A-Za-z][\w.-]*)[=<>]", re.MULTILINE)
MODELS = {
    "pybullet_data": "pybullet_data",
    "example-robot-data": "cmeel.prefix/share/example-robot-data/robots",
}
"""Folders of robots and objects among the installed Python packages, by package; each subfolder is a model."""

Row = tuple[str, str, str]
"""Name, version and licences of a part."""


def licences() -> str:
    """Lists the licences of all parts: packages here, robot models, Python packages and Debian packages.

    The names are those in the files of each part: package.xml, licence files of models, metadata of Python packages,
    and /usr/share/doc/PACKAGE/copyright. The list has the packages that this workspace asks for. Packages that Debian
    adds as their dependencies have such a file, too.
    """
    root = workspace()
    sections = {
        "Packages of this workspace, with their worlds, robots and meshes": own_packages(root),
        "Robots and objects of Python packages": installed_models(),
        "Python packages (base)": python_packages(root / "requirements/base.txt"),
        **{
            f"Python packages (extra {path.stem})": python_packages(path)
            for path in sorted(root.glob("requirements/extras/*.txt"))
        },
        "Debian packages": debian_packages(root / "requirements/apt-packages.txt", DEBIAN_DOCS),
    }
    return "\n\n".join(f"{title}\n{table(rows)}" for title, rows in sections.items())


def table(rows: Iterable[Row]) -> str:
    """Returns rows as lines with aligned columns."""
    return "\n".join(f"  {name:<42} {version:<18} {licence}" for name, version, licence in rows)


def own_packages(root: Path) -> Iterator[Row]:
    """Yields the packages of a workspace, from their package.xml."""
    for package in sorted(map(parse_package, root.glob("src/**/package.xml")), key=lambda each: each.name):
        yield package.name, package.version, shown(package.licenses)


def installed_models() -> Iterator[Row]:
    """Yields the models of the installed Python packages."""
    for place in sorted({str(each.locate_file("")) for each in metadata.distributions()}):
        for name, folder in MODELS.items():
            if Path(place, folder).is_dir():
                yield from models(name, Path(place, folder))


def models(name: str, folder: Path) -> Iterator[Row]:
    """Yields the subfolders of a folder that have a licence file, and one row for the other subfolders.

    Args:
        name: Name of the folder in the rows.
        folder: Folder whose subfolders are models.
    """
    others = 0
    for model in sorted(path for path in folder.iterdir() if path.is_dir()):
        files = [path for path in sorted(model.iterdir()) if LICENCE_FILE.fullmatch(path.name)]
        others += not files
        for file in files:
            yield f"{name}/{model.name}", "", f"{file.name}: {first_line(file)}"
    if others:
        yield f"{name}/*", "", f"{others} more folders without a licence file"


def first_line(file: Path) -> str:
    """Returns the first line of a text file that has letters, at most 60 characters of it."""
    lines = (line.strip(" #*-/") for line in file.read_text(encoding="utf-8", errors="replace").splitlines())
    return next((line[:60] for line in lines if re.search("[A-Za-z]", line)), UNKNOWN)


def python_packages(requirements: Path) -> Iterator[Row]:
    """Yields the packages that a file of requirements names, from the metadata of the installed packages."""
    for name in REQUIREMENT.findall(requirements.read_text(encoding="utf-8")):
        try:
            found = metadata.metadata(name)
        except metadata.PackageNotFoundError:
            yield name, "not installed", ""
            continue
        classifiers = [each.split(" :: ") for each in found.get_all("Classifier", [])]
        classified = [parts[-1] for parts in classifiers if parts[0] == "License" and len(parts) > 2]
        lines = [*found.get_all("License-Expression", []), *classified, *found.get_all("License", [])]
        known = [line for line in lines if line and line != "UNKNOWN"]
        yield name, found["Version"], known[0].splitlines()[0] if known else UNKNOWN


def debian_packages(requirements: Path, docs: Path) -> Iterator[Row]:
    """Yields the packages that a list names, from their files `copyright` below a folder."""
    text = re.sub("#.*", "", requirements.read_text(encoding="utf-8"))
    for name in sorted(text.split()):
        file = docs / name / "copyright"
        if not file.exists():
            yield name, "not installed", ""
            continue
        lines = file.read_text(encoding="utf-8", errors="replace")
        named = re.findall(r"^License:[ \t]*(\S.*)$", lines, re.MULTILINE)
        yield name, "", shown(named) if lines.startswith("Format:") and named else f"see {file}"


def shown(names: Iterable[str]) -> str:
    """Joins names of licences, each once, and counts those beyond the first five."""
    unique = list(dict.fromkeys(names))
    more = f" and {len(unique) - MAX_SHOWN} more" if len(unique) > MAX_SHOWN else ""
    return ", ".join(unique[:MAX_SHOWN]) + more
