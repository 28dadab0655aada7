"""The notebooks of docs run by the extra `notebook`, with their plots and pictures."""

from __future__ import annotations

import base64
import io
import sys
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from PIL import Image

DOCS = Path(__file__).resolve().parents[4] / "docs"
NOTEBOOKS = ("notebook.ipynb", "notebook_episode.ipynb")


@pytest.fixture(scope="module")
def cells(tmp_path_factory: pytest.TempPathFactory) -> dict[str, nbformat.NotebookNode]:
    """Cells of both after a run, by id."""
    folder = tmp_path_factory.mktemp("notebook")
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        for name in ("JUPYTER_RUNTIME_DIR", "IPYTHONDIR", "MPLCONFIGDIR"):
            patch.setenv(name, str(folder))
        for name in NOTEBOOKS:
            notebook = nbformat.read(DOCS / name, as_version=4)
            notebook.cells.insert(0, nbformat.v4.new_code_cell("import sys\nsys.prefix", id="probe"))
            NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
            found |= {cell.id: cell for cell in notebook.cells}
    return found


def shown(cell: nbformat.NotebookNode) -> str:
    """Returns the text of a cell's result."""
    return "".join(each.data["text/plain"] for each in cell.outputs if each.output_type == "execute_result")


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_it_is_kept_without_results(name):
    cells = nbformat.read(DOCS / name, as_version=4).cells
    assert all(not cell.outputs and cell.execution_count is None for cell in cells if cell.cell_type == "code")


@pytest.mark.thorough
def test_it_runs_with_the_python_of_the_workspace(cells):
    assert shown(cells["probe"]) == repr(sys.prefix)
    assert shown(cells["list-bodies"]) == "['work_area', 'floor', 'box', 'kuka_lwr']"
    assert shown(cells["swing"]) == "200"


def test_episode_runs_again_and_another_push_differs(cells):
    assert shown(cells["write-table"]) == "(200, 16)"
    assert shown(cells["run-again"]) == "(True, True)"
    assert shown(cells["run-otherwise"]) == "False"


@pytest.mark.parametrize("cell", ["plot", "plot-episode", "camera"])
def test_plot_and_picture_are_shown(cells, cell):
    (picture,) = (each.data["image/png"] for each in cells[cell].outputs if "image/png" in each.get("data", {}))
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB"))
    assert min(pixels.shape[:2]) > 200
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 50, "more than an empty frame"
