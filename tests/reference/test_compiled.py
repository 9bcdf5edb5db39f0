"""What numba keeps is forgotten when any source file is newer."""

import os

from reference.compiled import forget_stale


def test_stale_indices_are_removed_and_fresh_ones_kept(tmp_path):
    (tmp_path / "__pycache__").mkdir()
    files = {"caller.py": 100, "callee.py": 300, "__pycache__/caller.nbi": 200, "__pycache__/callee.nbi": 400}
    for name, changed in files.items():
        (tmp_path / name).write_text("")
        os.utime(tmp_path / name, (changed, changed))
    forget_stale(tmp_path)
    assert sorted(path.name for path in (tmp_path / "__pycache__").iterdir()) == ["callee.nbi"]
