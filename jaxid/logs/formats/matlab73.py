"""MATLAB files of version 7.3, which are HDF5 files, by h5py: variables as SciPy gives those of older versions.

MATLAB writes arrays column by column, so that they stand transposed; a struct is a group, text is 16 bit numbers that say so
("char" in the attribute MATLAB_class). Cells, and arrays of structs, are references and are left out, as objects are.
"""

from pathlib import Path
from typing import Any

import numpy as np

from ..finding import LogError

_CLASS, _EMPTY = "MATLAB_class", "MATLAB_empty"
_DEEPEST = 8


def _value(entry: Any, depth: int) -> Any:
    """One variable: a dict for a struct, text, or an array without dimensions of one; None for anything else."""
    import h5py

    if isinstance(entry, h5py.Group):
        return {} if depth > _DEEPEST else {name: _value(inner, depth + 1) for name, inner in entry.items()}
    if not isinstance(entry, h5py.Dataset) or entry.attrs.get(_EMPTY, 0) or entry.dtype.kind not in "biuf":
        return None
    values = np.squeeze(np.asarray(entry[()]).T)
    kind = entry.attrs.get(_CLASS, b"")
    if (kind.decode() if isinstance(kind, bytes) else str(kind)) == "char":
        return "".join(map(chr, np.atleast_1d(values).astype(int).ravel()))
    return values


def load(path: Path) -> dict[str, Any]:
    """The variables of a file, by name. Raises `LogError` without h5py, and whatever h5py does of damaged bytes."""
    try:
        import h5py
    except ImportError:
        raise LogError(
            f"{path} is a MATLAB file of version 7.3, and reading it needs the package h5py; install it with: "
            "pip install jaxid-robots[mat73], or save it by save('run.mat', ..., '-v7')."
        ) from None
    with h5py.File(path, "r") as file:
        return {name: _value(entry, 0) for name, entry in file.items() if not name.startswith("#")}
