"""The command `deb`."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping
from importlib import metadata
from pathlib import Path

from catkin_pkg.package import parse_package

from custom_ros_tools.errors import InterfaceError

from .licences import REQUIREMENT
from .modules import workspace
from .release import SOURCE, version

PREFIX = Path("/opt/rpbi")
"""Folder of the installed package: `install` is the install space, and `.venv` next to it has the Python packages."""
NOT_AT_RUN_TIME = ("Building the workspace", "Tests")
"""Sections of requirements/apt-packages.txt that an installed package does not need."""
CHECKS = "# Checks\n"
"""Line of requirements/base.txt after which only packages for tests follow."""
OF_WORKSPACES = ("CMAKE_PREFIX_PATH", "ROS_PACKAGE_PATH", "PYTHONPATH", "PYTHONHOME")


def deb() -> str:
    """Builds a Debian package of everything, for computers that need neither this checkout nor a compiler.

    The package has the install space in /opt/rpbi/install, and Python packages that Debian lacks, without extras. It is
    for Debian 12. The first build takes some minutes. See docs/installation.md.
    """
    root = workspace()
    folder = root / ".rpbi/deb"
    tree = folder / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    install(root, folder, tree)
    copy_python_packages(root, tree / PREFIX.relative_to("/") / ".venv")
    compile_to = ("-f", "-q", "--invalidation-mode", "unchecked-hash", "-s", str(tree), "-p", "/")
    run("compileall", [sys.executable, "-m", "compileall", *compile_to, str(tree)])
    (tree / "usr/share/doc/rpbi").mkdir(parents=True)
    shutil.copy(root / "LICENSE", tree / "usr/share/doc/rpbi/copyright")
    architecture = run("dpkg", ["dpkg", "--print-architecture"]).strip()
    package = root / f"out/rpbi_{version(root)}_{architecture}.deb"
    (tree / "DEBIAN").mkdir()
    (tree / "DEBIAN/control").write_text(control(root, architecture), encoding="utf-8")
    package.parent.mkdir(exist_ok=True)
    run("dpkg-deb", ["dpkg-deb", "--root-owner-group", "-Zzstd", "--build", str(tree), str(package)])
    return f"built: {package.relative_to(root)}"


def install(root: Path, folder: Path, tree: Path) -> None:
    """Builds a workspace for the install space in `PREFIX`, and installs it below another root folder.

    Args:
        root: The workspace, after `./rpbi setup`.
        folder: Folder of the build, which is kept for the next one.
        tree: The other root folder.
    """
    clean = {name: value for name, value in os.environ.items() if name not in OF_WORKSPACES}
    options = {
        "CATKIN_DEVEL_PREFIX": folder / "devel",
        "CMAKE_INSTALL_PREFIX": PREFIX / "install",
        "PYTHON_EXECUTABLE": "/usr/bin/python3",
        "CATKIN_ENABLE_TESTING": "OFF",
    }
    given = [f"-D{name}={value}" for name, value in options.items()]
    run("cmake", ["cmake", "-S", str(root / "src"), "-B", str(folder / "build"), *given], clean)
    run("make", ["make", "--directory", str(folder / "build"), "install"], {**clean, "DESTDIR": str(tree)})


def copy_python_packages(root: Path, venv: Path) -> None:
    """Copies the Python packages that are needed at run time to where `setup.bash` looks for them."""
    target = venv / f"lib/python{sys.version_info[0]}.{sys.version_info[1]}/site-packages"
    wanted = (root / "requirements/base.txt").read_text(encoding="utf-8").partition(CHECKS)[0]
    for name in REQUIREMENT.findall(wanted):
        for file in metadata.distribution(name).files or ():
            if ".." not in file.parts and file.suffix != ".pyc":
                (target / file).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(file.locate(), target / file)


def control(root: Path, architecture: str) -> str:
    """Returns the control file of a workspace's package, see deb-control(5)."""
    package = parse_package(root / SOURCE)
    python = f"{sys.version_info[0]}.{sys.version_info[1]}"
    after = f"{sys.version_info[0]}.{sys.version_info[1] + 1}"
    depends = [f"python3 (>= {python})", f"python3 (<< {after})", *debian_packages(root)]
    return f"""Package: rpbi
Version: {version(root)}
Architecture: {architecture}
Maintainer: {package.maintainers[0].name} <{package.maintainers[0].email}>
Depends: {", ".join(depends)}
Section: science
Priority: optional
Description: contact simulation for ROS 1, with worlds in YAML
 Run 'source {PREFIX}/install/setup.bash' and then
 'roslaunch rpbi_examples basic_example_kuka_lwr.launch'.
"""


def debian_packages(root: Path) -> list[str]:
    """Returns the sorted names of the Debian packages that a workspace needs at run time."""
    text = (root / "requirements/apt-packages.txt").read_text(encoding="utf-8")
    parts = re.split(r"^# (.*)\n", text, flags=re.MULTILINE)
    sections = dict(zip(parts[1::2], parts[2::2]))
    kept = [re.sub("#.*", "", names) for title, names in sections.items() if title not in NOT_AT_RUN_TIME]
    return sorted(" ".join(kept).split())


def run(name: str, command: Iterable[str], environment: Mapping[str, str] | None = None) -> str:
    """Runs a program, and returns its output.

    Raises:
        InterfaceError: If the program fails; the message has the end of its output.
    """
    done = subprocess.run([*command], env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode:
        raise InterfaceError(f"{name} failed: {done.stdout[-2000:].strip()}")
    return done.stdout
