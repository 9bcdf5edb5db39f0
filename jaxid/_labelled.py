"""Arrays with named axes and units, as xarray has them; xarray is an extra."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray

Column = tuple[tuple[str, ...], np.ndarray, Mapping[str, str]]
"""Names of the axes, values, and attributes such as units."""


def labelled(
    over: Mapping[str, Any], columns: Mapping[str, Column], attributes: Mapping[str, str] | None = None
) -> "xarray.Dataset":
    """A data set of `columns` by name over the coordinates `over`. Raises `ImportError` with what to install."""
    try:
        import xarray
    except ImportError:
        raise ImportError("to_xarray() needs xarray; install it with: pip install jaxid-robots[xarray]") from None
    return xarray.Dataset(dict(columns), dict(over), attributes)
