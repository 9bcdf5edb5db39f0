"""The documentation's links, its list of public names, and, where Sphinx is, its strict build."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import jaxid

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "benchmarks/README.md")]
PAGES += sorted(DOCS.rglob("*.md"))


def named(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_what_a_page_links_to_is_there(page):
    """Pages, pictures and notebooks of this repository; what is after `#` is checked by the strict build."""
    text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(encoding="utf-8"), flags=re.S)
    targets = [target.split("#")[0] for target in re.findall(r"\]\(([^)\s]+)\)", text)]
    missing = [target for target in targets if target and ":" not in target and not (page.parent / target).exists()]
    assert not missing


def test_the_reference_has_every_public_name_once():
    listed = re.findall(r"^\.\. auto\w+:: jaxid\.(\w+)$", (DOCS / "api.md").read_text(encoding="utf-8"), re.M)
    assert sorted(listed) == sorted(jaxid.__all__)


def test_the_first_page_leads_to_every_page():
    """By a table of contents, which is the site's menu, and by a link, which works on a code host, too."""
    blocks = "\n".join(re.findall(r"```\{toctree\}\n(.*?)```", (DOCS / "index.md").read_text(encoding="utf-8"), re.S))
    entries = [re.sub(r".*<(.*)>", r"\1", line) for line in blocks.splitlines() if line and line[0] != ":"]
    in_menu = {(DOCS / f"{entry}.md").resolve() for entry in entries}
    assert in_menu | {DOCS / "index.md"} == set(PAGES)
    linked = set(re.findall(r"\]\(([^)#\s]+)\)", (DOCS / "index.md").read_text(encoding="utf-8")))
    assert {named(page) for page in DOCS.rglob("*.md") if page.name != "index.md"} <= {
        f"docs/{name}" for name in linked
    }


@pytest.mark.slow
@pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in ("sphinx", "myst_nb", "furo")),
    reason="the site needs the extra 'docs'",
)
def test_the_site_is_built_without_a_warning(tmp_path):
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-d", str(tmp_path / "kept")]
    path = os.pathsep.join((str(ROOT), os.environ.get("PYTHONPATH", "")))
    built = subprocess.run(
        [*command, "-c", str(DOCS), str(ROOT), str(tmp_path / "site")],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stderr
    reference = (tmp_path / "site/docs/api.html").read_text(encoding="utf-8")
    assert not [name for name in jaxid.__all__ if f'id="jaxid.{name}"' not in reference]
    assert "Stribeck friction" in (tmp_path / "site/notebooks/explain.html").read_text(encoding="utf-8")
