"""The pages name files and commands that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "benchmarks/README.md", *sorted((ROOT / "docs").glob("*.md"))]
FILES = r"(?<![\w/.])((?:tests|jaxid|benchmarks|reference|notebooks)/[\w./-]*\.(?:py|ipynb))"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_names_exists(page):
    text = page.read_text(encoding="utf-8")
    missing = [name for name in re.findall(FILES, text) if not (ROOT / name).exists()]
    for module in re.findall(r"python -m (benchmarks(?:\.\w+)*)", text):
        path = ROOT / module.replace(".", "/")
        if not path.with_suffix(".py").exists() and not (path / "__main__.py").exists():
            missing.append(module)
    assert not missing


@pytest.mark.slow
def test_the_programs_of_the_page_on_programs_run(axis_log):
    """With the scatter of two hundred fits as the standard errors say."""
    import numpy as np
    import optimistix

    import jaxid

    inputs = np.repeat(np.random.default_rng(3).uniform(-2, 2, 25), 10)
    logs = jaxid.LogSet([axis_log("a", inputs, 0.02, 1, position=False, Fc=0.3)])
    names = {"robot": jaxid.Axis(), "logs": logs, "optimistix": optimistix}
    for code in re.findall(r"```python\n(.*?)```", (ROOT / "docs/programs.md").read_text(encoding="utf-8"), re.S):
        exec(code, names)
    errors = np.sqrt(np.diag(np.asarray(names["fit"].covariance)))
    assert np.all(np.abs(names["scatter"] / errors - 1) < 0.25)
