"""The pictures of the pages: the table of scripts that draw them, their use, and the few that no script draws."""

from __future__ import annotations

import ast
import re
import runpy
from collections.abc import Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "dev/pictures"
PICTURES: Mapping[str, str] = runpy.run_path(str(FOLDER / "draw.py"))["PICTURES"]
NO_SCRIPT = frozenset({"reality_pushes_3.png", "reality_tosses.png"})
"""Images that no script in dev draws again: `./rpbi reality` draws them from data that users download."""


def functions(file: Path) -> set[str]:
    """Returns the names of a module's functions."""
    tree = ast.parse(file.read_text()) if file.exists() else ast.Module([], [])
    return {each.name for each in tree.body if isinstance(each, ast.FunctionDef)}


def without_function(pictures: Mapping[str, str], folder: Path) -> list[str]:
    """Pictures whose functions are not in the modules that the table names."""
    places = {name: place.partition(":") for name, place in pictures.items()}
    return [
        name for name, (module, _, function) in places.items() if function not in functions(folder / f"{module}.py")
    ]


def images_of(pages: Path) -> set[str]:
    """Returns the names of the images that pages use."""
    texts = [page.read_text() for page in (*pages.glob("*.md"), *pages.glob("docs/*.md"))]
    return {name for text in texts for name in re.findall(r"images/(\w+\.\w+)", text)}


def unused(pictures: Mapping[str, str], pages: Path) -> list[str]:
    """Pictures of the table that no page uses."""
    return sorted(pictures.keys() - images_of(pages))


def unexplained(pictures: Mapping[str, str], no_script: frozenset[str], root: Path) -> list[str]:
    """Images that no script draws and the list does not have, and names of the list that it should not have."""
    scripts = "".join(path.read_text() for path in root.glob("dev/tools/**/*.py"))
    images = {path.name for path in root.glob("docs/images/*")}
    drawn = {name for name in images if name in pictures or name in scripts}
    return sorted((images - drawn - no_script) | (no_script - (images - drawn)))


def test_each_picture_has_a_function():
    assert PICTURES and without_function(PICTURES, FOLDER) == []


def test_a_picture_without_a_function_is_found(tmp_path):
    (tmp_path / "renders.py").write_text("def cup(path): ...\n\n\nspoon = cup\n")
    (tmp_path / "windows.py").touch()
    wrong = {"spoon.png": "renders:spoon", "fork.png": "windows:fork", "knife.png": "plots:knife"}
    assert without_function({"cup.png": "renders:cup", **wrong}, tmp_path) == list(wrong)


def test_each_picture_is_used():
    assert unused(PICTURES, ROOT) == []


def test_a_picture_that_no_page_uses_is_found(tmp_path):
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text("![Cup](docs/images/cup.png)")
    (tmp_path / "docs/page.md").write_text("![Plate](images/plate.gif) fork.png")
    table = {"cup.png": "renders:cup", "fork.png": "renders:fork", "plate.gif": "renders:plate"}
    assert unused(table, tmp_path) == ["fork.png"]


def test_each_image_has_a_script_or_is_on_the_list():
    assert unexplained(PICTURES, NO_SCRIPT, ROOT) == []


def test_an_image_without_a_script_is_found(tmp_path):
    for folder in ("docs/images", "dev/tools"):
        (tmp_path / folder).mkdir(parents=True)
    for name in ("cup.png", "plate.png", "fork.png", "spoon.png"):
        (tmp_path / "docs/images" / name).touch()
    (tmp_path / "dev/tools/draw_plate.py").write_text('PATH = "plate.png"')
    table, no_script = {"cup.png": "renders:cup"}, frozenset({"cup.png", "fork.png", "glass.png"})
    assert unexplained(table, no_script, tmp_path) == ["cup.png", "glass.png", "spoon.png"]


@pytest.mark.thorough
def test_a_world_is_rendered():
    from rpbi.world import World

    photographer = runpy.run_path(str(FOLDER / "render.py"))["Photographer"]
    world = World.from_file("{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml", connection_mode=2)
    box, floor = (-0.1, -0.2, 0.06), (-0.1, -0.6, 0.0)
    camera = photographer((-0.1, -2.0, 1.2), box, size=(160, 120))
    picture = camera.picture(world)
    world.close()

    def is_orange(point: tuple[float, float, float]) -> bool:
        red, _, blue = picture.getpixel(tuple(map(round, camera.pixel(point))))
        return red > 2 * blue

    assert picture.size == (160, 120) and is_orange(box) and not is_orange(floor)


def test_rviz_shows_no_panels_in_pictures(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    rviz_content = runpy.run_path(str(FOLDER / "rviz_view.py"))["rviz_content"]
    config = ROOT / "src/rpbi_examples/rviz/clutter.rviz"
    content = rviz_content(
        config, {"TF": None, "World": {"Alpha": 0.5}, "Path": {"Class": "rviz/Path"}}, {"Yaw": 1.0}, 2
    )
    manager = content["Visualization Manager"]
    displays = {each["Name"]: each for each in manager["Displays"]}
    assert content["Panels"] == [] and displays.keys() == {"Grid", "World", "Coloured point cloud", "Path"}
    assert displays["Coloured point cloud"]["Size (Pixels)"] == 4, "twice that of the file"
    assert displays["World"]["Alpha"] == 0.5 and manager["Views"]["Current"]["Yaw"] == 1.0
    with pytest.raises(KeyError, match="Wrld"):
        rviz_content(config, {"Wrld": {"Alpha": 0.5}}, {})
