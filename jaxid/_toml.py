"""TOML files that people wrote: data, and one kind of error for whatever is wrong with them."""

import tomllib
from pathlib import Path
from typing import Any


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file, with or without a byte-order mark.

    Raises `OSError` if it cannot be opened and `ValueError`, with its cause in one line, if it is not TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except RecursionError:
        raise ValueError("brackets nested too deeply") from None
    except ValueError as error:  # its syntax, its encoding, or an integer of thousands of digits
        raise ValueError(" ".join(str(error).split())[:200]) from None


def shown(value: object) -> str:
    """What stands in a file, short enough for a message and on one line."""
    if isinstance(value, str) and value.isprintable() and len(value) <= 60:
        return value
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:80]}..."
