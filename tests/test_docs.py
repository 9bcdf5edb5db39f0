"""The pages name files and commands that exist, and print what they say."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "benchmarks/README.md")]
PAGES += sorted((ROOT / "docs").rglob("*.md"))
HOW_TO = ("record", "robot", "speed_commands", "effect", "bad_fit")
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


def test_what_is_to_be_installed_is_this_package():
    """`jaxid` alone is a stranger's distribution on the public package index; ours is `jaxid-robots`."""
    code = [path for path in (ROOT / "jaxid").rglob("*") if path.suffix in (".py", ".pyi", ".jinja", ".js", ".md")]
    for page in [*PAGES, *code, *(ROOT / "notebooks").glob("*.ipynb"), ROOT / "pyproject.toml"]:
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"pip install[^\n`&]*\bjaxid(?![-\w./])|jaxid\[\w+[\],]", text), page.name


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


def without_numbers(line: str) -> str:
    return " ".join(re.sub(r"[-+−]?\d[\d.e+-]*", "#", line).split())


def run_as_in_a_notebook(code: str, names: dict) -> None:
    """Run one block; what its last line is worth is printed."""
    tree = ast.parse(code)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "<page>", "exec"), names)
    if last is not None:
        value = eval(compile(ast.Expression(last.value), "<page>", "eval"), names)
        if value is not None:
            print(value)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["README.md", "docs/quickstart.md", *(f"docs/howto/{page}.md" for page in HOW_TO)])
def test_what_a_page_tells_to_type_prints_what_it_says(name, tmp_path, monkeypatch, capsys):
    """Every block of Python, one after the other; the block of text before the next one has what was printed."""
    monkeypatch.syspath_prepend(tmp_path)
    text, names = (ROOT / name).read_text(encoding="utf-8"), {"__name__": "__main__"}
    blocks = re.findall(r"(?:`(\w+\.py)`:\n\n)?```(python|text)\n(.*?)```", text, re.S)
    assert any(kind == "python" for _, kind, _ in blocks)
    printed = ""
    for file, kind, block in blocks:
        if file:
            (tmp_path / file).write_text(block, encoding="utf-8")
        if kind == "python":
            run_as_in_a_notebook(block, names)
            printed = capsys.readouterr().out
        else:
            assert block.splitlines()[0] in printed
            # Last digits may differ elsewhere; words may not.
            said = {without_numbers(line) for line in printed.splitlines()}
            assert [line for line in block.splitlines() if without_numbers(line) not in said] == []
