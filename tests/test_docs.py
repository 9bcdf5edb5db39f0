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
