"""WPILib's struct schemas: text such as `Translation2d translation;Rotation2d rotation`, and bytes decoded by it.

Fields follow one another without gaps, in little-endian byte order. Bit fields are left out: no measured number of WPILib's
own structs is one.
"""

import re
import struct
from collections.abc import Mapping
from typing import NamedTuple

_CODES = {
    "bool": "?", "int8": "b", "uint8": "B", "char": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I",
    "int64": "q", "uint64": "Q", "float": "f", "float32": "f", "double": "d", "float64": "d",
}  # fmt: skip
_FIELD = re.compile(r"(?:enum\s*)?(?:\{[^}]*\}\s*)?([\w/:]+)\s+(\w+)\s*(?:\[\s*(\d+)\s*\])?")
_LONGEST_ARRAY = 32
_LONGEST_FIELD = 128
_MOST = 1024
_DEEPEST = 8


class StructError(ValueError):
    """A schema or bytes that do not fit it."""


class Struct(NamedTuple):
    """A schema's numbers: format code and path of each, and their size in bytes altogether."""

    codes: str
    paths: tuple[str, ...]

    def numbers(self, name: str, data: bytes, array: bool) -> list[tuple[str, float]]:
        """The numbers of one record below `name`; raises `StructError` if the bytes do not fit."""
        size = struct.calcsize("<" + self.codes)
        count, rest = divmod(len(data), size) if size else (0, len(data))
        if rest or (count != 1 and not array):
            raise StructError(f"{name} has {len(data)} bytes where its struct has {size}")
        found = []
        for index in range(min(count, _LONGEST_ARRAY)):
            values = struct.unpack_from("<" + self.codes, data, index * size)
            place = f"{name}[{index}]" if array else name
            found += [(f"{place}.{path}", float(value)) for path, value in zip(self.paths, values, strict=True)]
        return found


def struct_of(kind: str, schemas: Mapping[str, str], depth: int = 0) -> Struct:
    """The struct called `kind`, by the `schemas` of a log (text by name); raises `StructError`."""
    if kind not in schemas or depth > _DEEPEST:
        raise StructError(f"there is no schema of struct {kind[:40]!r}, or one that holds itself")
    codes, paths = "", []
    for part in filter(None, (part.strip() for part in schemas[kind].split(";"))):
        field = _FIELD.fullmatch(part)
        if field is None:
            raise StructError(f"the schema of struct {kind[:40]!r} says {part[:40]!r}, which is not read here")
        inner, name, count = field[1], field[2], field[3]
        places = [name] if count is None else [f"{name}[{k}]" for k in range(min(int(count), _LONGEST_FIELD))]
        own = Struct(_CODES[inner], ("",)) if inner in _CODES else struct_of(inner, schemas, depth + 1)
        for place in places:
            codes += own.codes
            paths += [f"{place}.{path}" if path else place for path in own.paths]
        if len(paths) > _MOST:
            raise StructError(f"struct {kind[:40]!r} has more than {_MOST} numbers")
    return Struct(codes, tuple(paths))
