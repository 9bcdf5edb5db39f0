"""The one way in which results become JSON: what is not a finite number is null, whatever it was."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ._atomic import write_text


def plain(value: Any) -> Any:
    """`value` as JSON has it: mappings, lists, strings, and finite numbers; NaN and infinities become None.

    A number that is not finite means that there is none: the standard error of a fixed parameter, the error of a
    simulation that diverges. Raises `TypeError` for what JSON cannot hold.
    """
    if isinstance(value, Mapping):
        return {str(name): plain(own) for name, own in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(own) for own in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


def as_json(document: Mapping[str, Any]) -> str:
    """The text of a JSON file."""
    return json.dumps(plain(document), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def write_json(path: str | Path, document: Mapping[str, Any]) -> None:
    """Write the file, all of it or nothing. Raises `OSError` if the folder cannot be written."""
    write_text(path, as_json(document))
