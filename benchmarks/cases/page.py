"""The page of `benchmarks.silent`."""
from pathlib import Path


def write(rows: list[dict], page: Path) -> None:
    raise NotImplementedError
