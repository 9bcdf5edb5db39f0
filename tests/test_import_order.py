"""Data flows one way: no package imports from a later one, anywhere in its files."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "jaxid"
ORDER = (
    "kernel", "logs", "checks", "robots", "effects", "simulation", "estimate", "design", "explanation", "report",
    "papers", "live", "cli",
)  # fmt: skip


def packages_imported(path: Path) -> set[str]:
    """Packages of jaxid that a file imports from, at its top or inside its functions."""
    here = ("jaxid", *path.relative_to(ROOT).with_suffix("").parts)
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            targets = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(here[: len(here) - node.level]) if node.level else ""
            module = ".".join(part for part in (base, node.module) if part)
            targets = [f"{module}.{alias.name}" for alias in node.names]
        else:
            continue
        found |= {target.split(".")[1] for target in targets if target.startswith("jaxid.")}
    return found


def rank(name: str) -> int:
    """Place of a package in the order; a module beside the packages stands with the latest package it imports."""
    if name in ORDER:
        return ORDER.index(name)
    path = ROOT / f"{name}.py"
    return max((rank(other) for other in packages_imported(path)), default=-1) if path.exists() else -1


@pytest.mark.parametrize("package", [p for p in ORDER if (ROOT / p / "__init__.py").exists()])
def test_a_package_imports_from_earlier_ones_only(package):
    files = sorted((ROOT / package).rglob("*.py"))
    assert files
    for path in files:
        wrong = {name for name in packages_imported(path) if rank(name) > rank(package)}
        assert not wrong, f"{path.relative_to(ROOT)} imports from {sorted(wrong)}"


def test_no_package_stands_outside_the_order():
    packages = {path.parent.name for path in ROOT.glob("*/__init__.py")}
    assert packages <= set(ORDER)


def test_the_reference_simulator_knows_nothing_of_jaxid():
    for path in (ROOT.parent / "reference").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not any(name.split(".")[0] == "jaxid" for name in names), path.name


def modules_loaded_by(statement: str) -> set[str]:
    """What a fresh interpreter has imported after a statement."""
    search = os.pathsep.join([str(ROOT.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    run = subprocess.run(
        [sys.executable, "-c", f"{statement}; import sys; print(*sys.modules)"],
        env={**os.environ, "PYTHONPATH": search},
        capture_output=True,
        text=True,
        check=True,
    )
    return set(run.stdout.split())


def test_what_only_some_calls_need_is_not_imported_with_the_estimators():
    """Each takes a tenth of a second or more, before anything else can be done; `import scipy` gives its parts when used."""
    late = {"matplotlib", "optimistix", "jinja2", "scipy.stats", "scipy.signal", "scipy.optimize", "scipy.ndimage"}
    assert not late & modules_loaded_by("from jaxid import *")


def test_jaxid_and_its_command_line_wait_for_nothing_that_is_not_asked_for():
    """`import jaxid` and `jaxid --help` must not take the seconds that JAX, pandas and SciPy need."""
    slow = {"jax", "numpy", "pandas", "scipy", "pyarrow", "matplotlib", "jinja2", "llvmlite"}
    assert not slow & modules_loaded_by("import jaxid, jaxid.cli")
    assert slow & modules_loaded_by("from jaxid import Axis") >= {"jax", "numpy"}
