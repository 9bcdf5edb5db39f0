"""What the pages on results and misprints say about the papers is what the notebooks print and the tests hold."""

import re
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat", reason="notebooks need the extra 'notebook'")

ROOT = Path(__file__).parents[2]
TESTS = {
    "E": "tests/papers/pioneer/test_equations.py",
    "F": "tests/robots/test_pioneer_closed_form.py",
    "O": "tests/robots/test_omni.py",
    "P": "tests/papers/omni/test_methods.py",
    "T": "tests/papers/omni/test_tables.py",
}


def printed(notebook):
    """Parameter -> cells of the comparison's table in a notebook's committed output."""
    outputs = [o for cell in nbformat.read(ROOT / notebook, as_version=4).cells for o in cell.get("outputs", [])]
    texts = [
        o.data["text/plain"] for o in outputs if "data" in o and "Parameters\nparameter" in o.data.get("text/plain", "")
    ]
    (text,) = texts
    lines = text[text.index("Parameters\nparameter") : text.index("± is one standard error")].splitlines()[3:]
    rows = [re.split(r"\s{2,}", line.strip()) for line in lines if line.strip()]
    return {name: cells for name, *cells in rows}


def test_the_pioneers_table_on_the_page_of_results_is_the_notebooks():
    text = (ROOT / "docs/results.md").read_text(encoding="utf-8")
    found = printed("notebooks/pioneer_paper.ipynb")
    assert len(found) == 10
    for name, (_, true, *numbers) in found.items():
        (row,) = re.findall(rf"^\| {re.escape(name)} \|(.*)\|$", text, re.MULTILINE)
        _, shown, *cells = (cell.strip() for cell in row.split("|"))
        assert float(shown) == pytest.approx(float(true)) and cells == numbers, name


def test_the_omnis_numbers_on_the_page_of_results_are_the_notebooks():
    text = " ".join((ROOT / "docs/results.md").read_text(encoding="utf-8").split())
    found = printed("notebooks/omni_paper.ipynb")
    assert len(found) == 7
    for name, (_, true, _, _, by_output_error, _) in found.items():
        assert f"{name} {by_output_error} ({true})" in text


def test_every_test_that_the_page_on_misprints_names_exists():
    page = (ROOT / "docs/misprints.md").read_text(encoding="utf-8")
    there = {name for path in TESTS.values() for name in re.findall(r"def (test_\w+)", (ROOT / path).read_text())}
    named = set(re.findall(r"`(test_\w+)`", page))
    assert len(named) > 30 and named <= there, named - there
    for letter, name in re.findall(r"\(([EFOPT]) `(test_\w+)`", page):
        assert f"def {name}(" in (ROOT / TESTS[letter]).read_text(), (letter, name)
