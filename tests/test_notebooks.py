"""Every notebook runs from top to bottom in a fresh kernel, and the committed ones have been, and name no machine.

In the default run on less data (`LESS`): the first ten seconds of the demonstration's logs, three of them fitted, and five
effects to name. `pytest -m slow tests/test_notebooks.py` runs them as they are committed.
"""

import os
import re
import shutil
from itertools import islice
from pathlib import Path

import pytest

from jaxid import demo

nbformat = pytest.importorskip("nbformat", reason="notebooks need the extra 'notebook'")
nbclient = pytest.importorskip("nbclient", reason="notebooks need the extra 'notebook'")
pytest.importorskip("ipykernel", reason="notebooks need the extra 'notebook'")

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
CELL_SECONDS = 600
"""No cell takes this long; it stops a run that hangs."""
SAMPLES = 501
SHORTENED = ("omni", "pioneer", "unknown")
LEFT_OUT = ("fit_crawl", "fit_prbs_forward", "fit_turning", "fit_2", "fit_3", "fit_6")
EFFECTS = ("sensor_bias", "quadratic_drag", "stribeck_friction", "sublinear_viscous_friction", "asymmetric_friction")

LESS = """
import importlib
from pathlib import Path
from jaxid import demo

demo.folder = Path({folder!r}).joinpath
search, effects = (importlib.import_module(f"jaxid.{{name}}") for name in ("explanation.search", "effects"))
search.catalogue = lambda robot: [effect for effect in effects.catalogue(robot) if effect.id in {effects!r}]
"""


def by_name(path: Path) -> str:
    return path.stem


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def executed(path, before=""):
    """The notebook, run in a fresh kernel after the code `before`."""
    notebook = nbformat.read(path, as_version=4)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(before))
    client = nbclient.NotebookClient(
        notebook, timeout=CELL_SECONDS, kernel_name="python3", resources={"metadata": {"path": str(path.parent)}}
    )
    # The checkout comes first, whatever else is installed. A cell that fails raises CellExecutionError here.
    search = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    client.execute(env={**os.environ, "PYTHONPATH": search})
    return notebook


@pytest.fixture(scope="session")
def less_data(tmp_path_factory) -> Path:
    """A folder like the demonstration's, of fewer and shorter logs."""
    folder = tmp_path_factory.mktemp("demo_logs")
    for name in ("omni", "omni_paper", "pioneer", "pioneer_paper", "unknown"):
        shutil.copytree(demo.folder(name), folder / name)
    for name in SHORTENED:
        for path in (folder / name).glob("*.csv"):
            if path.stem in LEFT_OUT:
                path.unlink()
                continue
            with path.open(encoding="utf-8") as lines:
                first = list(islice(lines, SAMPLES + 1))
            path.write_text("".join(first), encoding="utf-8")
    return folder


@pytest.mark.parametrize("path", NOTEBOOKS, ids=by_name)
def test_notebook_runs(path, less_data):
    notebook = executed(path, LESS.format(folder=str(less_data), effects=EFFECTS))
    assert all(cell.execution_count for cell in code_cells(notebook))


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=by_name)
def test_notebook_runs_as_committed(path):
    assert all(cell.execution_count for cell in code_cells(executed(path, "pass")))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=by_name)
def test_committed_notebook_is_complete_and_clean(path):
    notebook = nbformat.read(path, as_version=4)
    cells = code_cells(notebook)
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1)), "run it from top to bottom"
    for cell in cells:
        assert "execution" not in cell.metadata, "leave out the run's times"
        for output in cell.outputs:
            assert output.output_type in ("execute_result", "display_data"), output
            text = "".join(str(output.data.get(kind, "")) for kind in ("text/plain", "text/html"))
            text = re.sub(r"data:image/png;base64,[\w+/=]+", "", text)
            found = re.search(r"(?<![\w.])/(?:root|home|tmp|work|Users|usr|opt)/\S*", text)
            assert not found, f"{found.group()} is a path of one machine" if found else ""
    assert set(notebook.metadata) == {"kernelspec", "language_info"}


def test_there_are_notebooks():
    assert {path.stem for path in NOTEBOOKS} >= {"explain", "omni_paper", "pioneer_paper"}
