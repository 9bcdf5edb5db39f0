"""Every notebook runs from top to bottom, and the committed ones have been, and name no machine.

In the default run in this process and on less data: the first ten seconds of the demonstration's logs, three of them fitted,
and four effects to name. `pytest -m slow tests/test_notebooks.py` runs them as they are committed, each in a fresh kernel.
"""

import importlib
import os
import re
import shutil
from itertools import islice
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from jaxid import demo
from jaxid.effects import catalogue

nbformat = pytest.importorskip("nbformat", reason="notebooks need the extra 'notebook'")
nbclient = pytest.importorskip("nbclient", reason="notebooks need the extra 'notebook'")
pytest.importorskip("ipykernel", reason="notebooks need the extra 'notebook'")
interactiveshell = pytest.importorskip("IPython.core.interactiveshell", reason="notebooks need the extra 'notebook'")

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
CELL_SECONDS = 600
"""No cell takes this long; it stops a run that hangs."""
SAMPLES = 501
SHORTENED = ("omni", "pioneer", "unknown")
LEFT_OUT = ("fit_crawl", "fit_prbs_forward", "fit_turning", "fit_2", "fit_3", "fit_6")
QUICK = ("omni_paper",)
"""What the default run runs."""
EFFECTS = ("sensor_bias", "quadratic_drag", "stribeck_friction", "actuator_dead_zone")


def by_name(path: Path) -> str:
    return path.stem


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def executed(path):
    """The notebook, run in a fresh kernel."""
    notebook = nbformat.read(path, as_version=4)
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


@pytest.fixture
def shell(monkeypatch):
    """A notebook's shell in this process, which has loaded and compiled already what a kernel would have to."""
    # A kernel of its own starts for every notebook in the slow test.
    shell = interactiveshell.InteractiveShell.instance()
    monkeypatch.chdir(ROOT / "notebooks")
    with plt.rc_context():
        yield shell
    plt.close("all")
    interactiveshell.InteractiveShell.clear_instance()


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=[] if path.stem in QUICK else pytest.mark.slow) for path in NOTEBOOKS],
    ids=by_name,
)
def test_notebook_runs(path, less_data, shell, monkeypatch):
    monkeypatch.setattr(demo, "folder", less_data.joinpath)
    searching = importlib.import_module("jaxid.explanation.search.from_the_back")
    monkeypatch.setattr(
        searching, "catalogue", lambda robot: [effect for effect in catalogue(robot) if effect.id in EFFECTS]
    )
    for cell in code_cells(nbformat.read(path, as_version=4)):
        # Pictures are drawn into memory here; `%matplotlib inline` is a kernel's.
        source = "\n".join(line for line in cell.source.splitlines() if not line.startswith("%matplotlib"))
        shell.run_cell(source).raise_error()


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=by_name)
def test_notebook_runs_as_committed(path):
    assert all(cell.execution_count for cell in code_cells(executed(path)))


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
    stems = {"bag_to_model", "cannot_know", "explain", "fleet", "methods", "omni_paper", "own_robot", "pioneer_paper"}
    assert {path.stem for path in NOTEBOOKS} >= stems
