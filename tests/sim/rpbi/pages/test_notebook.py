"""The notebook of docs runs by the extra `notebook`, with its plot and its picture."""

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

NOTEBOOK = Path(__file__).resolve().parents[4] / "docs/notebook.ipynb"


@pytest.fixture(scope="module")
def cells(tmp_path_factory: pytest.TempPathFactory) -> dict[str, nbformat.NotebookNode]:
    """Its cells after a run, by id."""
    folder = tmp_path_factory.mktemp("notebook")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    probe = nbformat.v4.new_code_cell("import sys\nsys.prefix", id="probe")
    notebook.cells.insert(0, probe)
    with pytest.MonkeyPatch.context() as patch:
        for name in ("JUPYTER_RUNTIME_DIR", "IPYTHONDIR", "MPLCONFIGDIR"):
            patch.setenv(name, str(folder))
        NotebookClient(notebook, timeout=300).execute()
    return {cell.id: cell for cell in notebook.cells}


def shown(cell: nbformat.NotebookNode) -> str:
    """Returns the text of a cell's result."""
    return "".join(each.data["text/plain"] for each in cell.outputs if each.output_type == "execute_result")


def test_it_is_kept_without_results():
    cells = nbformat.read(NOTEBOOK, as_version=4).cells
    assert all(not cell.outputs and cell.execution_count is None for cell in cells if cell.cell_type == "code")


def test_it_runs_with_the_python_of_the_workspace(cells):
    assert shown(cells["probe"]) == repr(sys.prefix)
    assert shown(cells["make-world"]) == "['work_area', 'floor', 'box', 'kuka_lwr']"
    assert shown(cells["swing"]) == "200"


@pytest.mark.parametrize("cell", ["plot", "camera"])
def test_plot_and_picture_are_shown(cells, cell):
    (picture,) = (each.data["image/png"] for each in cells[cell].outputs if "image/png" in each.get("data", {}))
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB"))
    assert min(pixels.shape[:2]) > 200
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 50, "more than an empty frame"
