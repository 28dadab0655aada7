"""The web site of the pages: strict, complete, without anything from elsewhere, and its search finds answers."""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import markdown
import mkdocs  # noqa: F401 (so that a run without the extra `site` skips this file)
import pytest
from markdown_it import MarkdownIt
from site_search import SiteSearch

import custom_ros_tools.console.docs as command

ROOT = Path(__file__).resolve().parents[1]
CONFIG = ROOT / "dev/site/mkdocs.yml"
OFFLINE = ("unshare", "--map-root-user", "--net")
"""Runs a command without any network."""
QUESTIONS = {
    "reinforcement learning": ("gym",),
    "Stable-Baselines3": ("gym", "questions"),
    "troubleshooting": ("questions",),
    "ROS 2": ("questions",),
    "macOS": ("questions",),
    "Windows": ("questions",),
    "Ubuntu 22": ("questions", "installation"),
    "MJCF": ("questions", "robots"),
    "SDF": ("questions", "robots"),
    "spawn object": ("commands", "worlds"),
    "contact forces": ("contacts", "clean_forces"),
    "target not reached": ("questions",),
    "object slips": ("hands", "questions"),
    "object turns in the grip": ("hands", "questions"),
    "restore state": ("replay_and_fork",),
    "sleeping bodies": ("questions",),
    "slow": ("slow",),
    "faster than real time": ("time",),
    "sim time": ("time", "concepts"),
    "wrist camera": ("cameras", "questions"),
    "EGL": ("cameras", "questions"),
    "LeRobot": ("datasets",),
    "raw data": ("data", "datasets"),
    "own gripper": ("hands",),
    "MoveIt": ("planning",),
    "motion planning": ("planning",),
    "collision-free motion": ("planning",),
    "system identification": ("identification",),
    "domain randomization": ("gym", "questions"),
    "sim to real": ("reality", "real_robots"),
    "mocap": ("motion_capture",),
    "motion capture": ("motion_capture",),
    "behavior cloning": ("lfd", "datasets"),
    "urdf not found": ("questions",),
    "teleoperate with spacemouse": ("teleoperation", "devices"),
    "randomize friction gym": ("gym",),
    "add table to scene": ("worlds",),
    "license": ("commands",),
    "penetration depth": ("contacts",),
    "run multiple robots": ("robots",),
    "how accurate is the contact model": ("physics",),
    "uninstall": ("installation", "questions"),
    "lidar": ("questions",),
    "World.from_file": ("python",),
    "inverse kinematics": ("ik",),
    "install": ("installation",),
    "robot does not move": ("questions", "robots"),
    "joint limits": ("robots",),
    "reset": ("time",),
    "color image": ("cameras",),
    "suction": ("hands",),
    "friction": ("dynamics", "contacts", "physics"),
    "export dataset to lerobot": ("datasets",),
    "change simulation timestep": ("time",),
    "pick and place": ("scenes",),
    "own URDF": ("robots",),
    "ground truth pose of object": ("topics_and_services",),
    "simulation is unstable": ("physics", "questions", "slow"),
    "how do I export a dataset to LeRobot": ("datasets",),
    "how to change the gravity": ("time", "worlds", "dynamics", "commands"),
    "why is my robot not moving": ("questions", "robots"),
    "determinism": ("replay_and_fork",),
    "snapshot": ("replay_and_fork",),
    "nullspace": ("ik",),
    "grasping": ("hands",),
    "getting started": ("tutorial",),
    "contribute": ("contributing",),
    "changelog": ("changelog",),
    "spawning objects": ("worlds",),
    "supported robots": ("example_robots",),
    "compliance": ("controllers",),
    "bimanual": ("example_dual_arm",),
    "1 kHz": ("reality", "mpc", "physics", "time"),
    "save simulation state": ("replay_and_fork",),
    "set gravity": ("dynamics", "worlds", "time", "commands", "topics_and_services"),
    "rosbag to csv": ("data",),
    "use my own xacro file": ("robots",),
    "Robotiq": ("from_the_release", "questions"),
    "gym env custom": ("gym",),
    "custom controller": ("controllers", "extending"),
    "custom sensor": ("extending",),
    "UR5 real robot": ("real_robots",),
    "simulation speed": ("slow", "time"),
    "change friction at runtime": ("dynamics",),
    "record video": ("windows", "data"),
    "save world to file": ("replay_and_fork",),
    "deformable object": ("soft_bodies",),
    "emergency stop": ("real_robots", "safety"),
    "randomizing": ("gym",),
    "debugging": ("questions",),
    "bibtex": ("citing",),
    "IMU": ("limits",),
    "tactile": ("contacts",),
    "admittance": ("controllers",),
    "terrain": ("worlds", "limits"),
    "weld": ("hands",),
    "getContactPoints": ("from_pybullet",),
    "setJointMotorControl2": ("from_pybullet",),
    "API reference": ("api/index",),
    "Python API": ("api/index", "python"),
    "joint torque control": ("controllers", "robots"),
    "velocity control": ("robots",),
    "solver iterations": ("physics",),
    "hand-eye calibration": ("tracking", "cameras"),
    "end-effector pose": ("ik",),
    "object falls through floor": ("physics",),
    "rpbi/kuka_lwr/joint_states": ("robots", "topics_and_services"),
    "UR10": ("example_robots",),
    "not supported": ("limits",),
    "apply external force": ("dynamics",),
    "stop simulation": ("time",),
    "why is my simulation so slow": ("slow",),
    "how to load urdf": ("robots",),
    "list of services": ("topics_and_services",),
    "set joint positions": ("robots",),
    "add my own robot": ("robots",),
    "safety": ("safety",),
    "save video": ("windows",),
    "forward kinematics": ("robot_model",),
    "GPU acceleration": ("limits",),
    "custom environment": ("gym",),
    "set base pose": ("bases", "worlds"),
    "pick up an object": ("hands",),
    "load dataset": ("datasets",),
    "self collision": ("worlds", "config_common"),
    "delete object": ("commands", "worlds"),
    "visualize contacts": ("contacts",),
    "send joint torques": ("robots", "controllers"),
    "quaternion": ("concepts",),
    "speed limit": ("safety", "robots"),
    "migrate from the original": ("from_the_release",),
    "real time factor": ("time",),
    "open gripper": ("hands",),
    "load cell": ("force_torque",),
}
"""Questions about simulators; for each, pages of which one has the answer."""


def build(config: Path, site: Path) -> subprocess.CompletedProcess[str]:
    """Builds a site without a network, where processes may be cut off from it."""
    offline = OFFLINE if subprocess.run([*OFFLINE, "true"], capture_output=True).returncode == 0 else ()
    words = (*offline, sys.executable, "-m", "mkdocs", "build", "--config-file", config, "--site-dir", site)
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    return subprocess.run(words, capture_output=True, text=True, env=environment, timeout=300.0)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the built site."""
    folder = tmp_path_factory.mktemp("site")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = build(CONFIG, folder)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stderr.splitlines() if not line.startswith("INFO")] == []
    assert used.ru_utime - before.ru_utime < 60.0, "processor time, which other programs do not lengthen"
    return folder


@pytest.fixture(scope="module")
def search(site: Path) -> SiteSearch:
    return SiteSearch(site)


def external(site: Path) -> list[str]:
    """Returns the addresses from which a site's pages and styles would load something."""
    loads = re.compile(r"""<(?:script|img|iframe|source|link)\b[^>]*?\b(?:src|href)=["']?((?:https?:)?//[^"' >]+)""")
    styles = re.compile(r"""(?:@import\s*|url\()["']?((?:https?:)?//[^"')]+)""")
    pages = [loads.findall(path.read_text()) for path in site.rglob("*.html")]
    return sorted({each for found in pages for each in found}) + sorted(
        {each for path in (*site.rglob("*.css"), *site.rglob("*.html")) for each in styles.findall(path.read_text())}
    )


def test_all_pages_are_in_the_navigation(site):
    listed = re.findall(r"^- \[[^\n]*?\]\(([\w/]+\.md)\): \S", (site / "llms.txt").read_text(), re.MULTILINE)
    assert sorted(listed) == sorted(
        [path.name for path in ROOT.glob("docs/*.md")] + [f"api/{path.name}" for path in ROOT.glob("dev/site/api/*.md")]
    )
    assert all((site / page).exists() and (site / page).with_suffix(".html").exists() for page in listed)


def test_tabs_begin_with_an_overview_of_their_pages(site, search):
    page = (site / "overview/control/index.html").read_text(encoding="utf-8")
    listed = dict(re.findall(r'<li><a href="\.\./\.\./(\w+)\.html">[^<]+</a>: ([^<]+)', page))
    assert {"ik", "planning", "safety", "real_robots"} <= listed.keys()
    assert all(text.strip() for text in listed.values())
    assert not search.pages("Control")[0].startswith("overview/")


def test_site_loads_nothing_from_elsewhere(site):
    assert external(site) == []
    assert 'class="mermaid"' not in "".join(path.read_text() for path in site.rglob("*.html")), (
        "its script is elsewhere"
    )


def test_loads_from_elsewhere_are_found(tmp_path):
    (tmp_path / "page.html").write_text(
        '<a href="https://a.example"></a><img alt="b" src="https://b.example/b.png"><script src=//c.example></script>'
        '<link rel="stylesheet" href="local.css"><style>@import "https://d.example"; x {background: url(//e.example)}'
    )
    found = ["//c.example", "https://b.example/b.png", "//e.example", "https://d.example"]
    assert external(tmp_path) == found


def test_links_have_headings_as_texts(site):
    """The pages name others by file, for readers of the repository."""
    assert "gym.md](gym.md" in (ROOT / "docs/questions.md").read_text()
    texts = re.findall(r"<a\b[^>]*>([^<]*\.md)</a>", "".join(path.read_text() for path in site.glob("*.html")))
    assert texts == []


def test_pictures_have_visible_captions(site):
    pages = {path.stem: path.read_text() for path in site.glob("*.html")}
    assert len(re.findall("<figcaption>", "".join(pages.values()))) > 60
    assert re.search('<figure><img alt="([^"]+)"[^>]*><figcaption>\\1</figcaption></figure>', pages["dynamics"])
    assert re.search('<figure><a [^>]*><img alt="([^"]+)"[^>]*></a><figcaption>\\1<', pages["index"])
    assert [name for name, html in pages.items() if "<p><img" in html] == []


def test_only_short_code_in_tables_is_marked(site):
    cells = re.findall(r"<td>.*?</td>", "".join((site / name).read_text() for name in ("gym.html", "planning.html")))
    assert '<td><code class="short">rpbi/Wiping-v0</code></td>' in cells
    assert [cell for cell in cells if cell.startswith("<td><code>the start is in collision")]


def test_planted_faults_are_named(tmp_path):
    shutil.copytree(CONFIG.parent, tmp_path / "dev/site", ignore=shutil.ignore_patterns("api", "__pycache__"))
    config = tmp_path / "dev/site" / CONFIG.name
    nav = "nav: [index.md, missing.md]\n\nvalidation:"
    config.write_text(re.sub(r"^nav:.*?^validation:", nav, config.read_text(), flags=re.DOTALL | re.MULTILINE))
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs/index.md").write_text(
        "# Home\n[1](nowhere.md) [2](#nothing) [3](lost.md#nothing) [4](lost.md#lost)"
    )
    (tmp_path / "docs/lost.md").write_text("# Lost\n")
    done = build(config, tmp_path / "site")
    assert done.returncode == 1
    for fault in (
        "'missing.md' is included in the 'nav' configuration, which is not found",
        'not included in the "nav" configuration:\n  - lost.md',
        "link 'nowhere.md'",
        "link '#nothing'",
        "link 'lost.md#nothing'",
        "extra.search names gym.md, which is not there",
    ):
        assert fault in done.stderr
    assert "lost.md#lost" not in done.stderr


@pytest.mark.parametrize("question", QUESTIONS)
def test_search_finds_the_answer(search, question):
    pages = [page[: -len(".html")] for page in search.pages(question)]
    first = [page for page in pages if not page.startswith("api/") or page == "api/index"][:3]
    assert set(QUESTIONS[question]) & set(first), first


def test_search_needs_no_server(site):
    """Tried by hand in Chromium; browsers start no worker from a file."""
    assert (site / "search/search_index.js").read_text(encoding="utf-8").startswith("var __index = {")
    assert '<script src="iframe-worker.js">' in (site / "index.html").read_text(encoding="utf-8")


def test_search_for_a_word_of_no_page_finds_nothing(search):
    assert search.pages("xylophone") == []


def shape(html: str) -> dict[str, int]:
    """Returns the number of parts of a page, by their kind."""
    return {kind: len(re.findall(rf"<{kind}\b", html)) for kind in ("ul", "ol", "li", "table", "tr", "pre", "h2", "h3")}


def as_repository_hosts_do(text: str) -> str:
    return MarkdownIt("commonmark").enable("table").render(text)


@pytest.mark.parametrize("page", sorted(ROOT.glob("docs/*.md")), ids=lambda path: path.stem)
def test_page_looks_as_on_repository_hosts(site, page):
    html = (site / page.with_suffix(".html").name).read_text()
    article = re.sub(r"(?s).*<article[^>]*>(.*)</article>.*", r"\1", html)
    assert shape(article) == shape(as_repository_hosts_do(page.read_text()))


def test_differently_read_list_is_found():
    text = "- one\n  - two\n"
    assert shape(markdown.markdown(text)) != shape(as_repository_hosts_do(text))


@pytest.mark.parametrize(("serve", "code"), [(False, 0), (True, 1)])
def test_missing_extra_is_named_in_one_line(monkeypatch, capsys, serve, code):
    monkeypatch.setattr(command, "files", lambda root: {})
    monkeypatch.setattr(command, "find_spec", lambda name: None)
    assert command.docs(serve=serve) == code
    assert capsys.readouterr().err == "no site: ./rpbi setup site installs the tools for it\n"
