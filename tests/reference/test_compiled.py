"""What numba keeps is forgotten when any source file is newer, and is of one signature."""

import importlib
import os
from pathlib import Path

import numpy as np
from numba.core.dispatcher import Dispatcher

import reference
from reference.compiled import compiled, forget_stale


def test_stale_indices_are_removed_and_fresh_ones_kept(tmp_path):
    (tmp_path / "__pycache__").mkdir()
    files = {"caller.py": 100, "callee.py": 300, "__pycache__/caller.nbi": 200, "__pycache__/callee.nbi": 400}
    for name, changed in files.items():
        (tmp_path / name).write_text("")
        os.utime(tmp_path / name, (changed, changed))
    forget_stale(tmp_path)
    assert sorted(path.name for path in (tmp_path / "__pycache__").iterdir()) == ["callee.nbi"]


def test_no_function_is_kept_that_takes_arguments_of_several_kinds():
    """Two processes that compile at once would give two signatures one number (numba's cache), and run each other's code."""
    files = Path(reference.__file__).parent.glob("*.py")
    modules = [importlib.import_module(f"reference.{path.stem}") for path in sorted(files) if path.stem != "__init__"]
    found = {name: value for module in modules for name, value in vars(module).items() if isinstance(value, Dispatcher)}
    assert {"mass_and_bias", "at", "dry", "beyond"} <= set(found)
    assert {name for name, dispatcher in found.items() if dispatcher.stats.cache_path} == set()


def test_what_is_compiled_for_one_signature_is_kept_and_as_a_callee_is_not():
    twice = compiled("float64(float64)")(_twice)
    assert twice(3.0) == 6.0
    assert twice.ready.stats.cache_path is not None
    assert twice.callee.stats.cache_path is None and twice.callee(np.float32(2.0)) == 4.0


def _twice(x):
    return 2.0 * x
