"""Results as plain values and arrays, and back: what a saved file holds.

Numbers, words, lists and mappings are written as JSON has them; arrays as NumPy's own files, tables as Parquet; objects by the
name of their class and their fields, each once however often it is referred to. A class or function is only ever looked up,
by name, among what is imported already or handed over: nothing in a file is imported or run.
"""

import dataclasses
import enum
import inspect
import io
import math
import sys
from collections.abc import Mapping
from types import FunctionType, MappingProxyType, ModuleType
from typing import Any

import jax
import numpy as np
import pandas as pd

from ._origin import Origin
from .logs import LogSet
from .parameters import ParameterTable

_AS_ONE = {LogSet: lambda value: tuple(value), ParameterTable: lambda value: dict(value)}
"""Classes that are no dataclasses, and the one value that each is made from."""
Reference = dict[str, Any]


class StoredError(ValueError):
    """What cannot be written or read; the message is what a sentence about the file goes on with."""


def name_of(thing: Any) -> str:
    """ "module:qualname" of a class or function."""
    return f"{thing.__module__}:{thing.__qualname__}"


# -- writing -----------------------------------------------------------------------------------------------------------
class Writer:
    """Takes a value apart into `objects`, which the value refers to by their place, and `files` of arrays by name."""

    def __init__(self) -> None:
        self.objects: list[dict[str, Any]] = []
        self.files: dict[str, bytes] = {}
        self._known: dict[int, tuple[Any, Reference]] = {}  # with the thing itself, so that its id stays its own

    def value(self, value: Any) -> Any:
        """`value` as JSON has it."""
        kind = type(value)
        if value is None or kind in (bool, int, str):
            return value
        if kind is float:
            return value if math.isfinite(value) else {"float": repr(value)}
        if kind is list:
            return [self.value(own) for own in value]
        if kind is tuple:
            return {"tuple": [self.value(own) for own in value]}
        if kind in (set, frozenset):
            return {kind.__name__: [self.value(own) for own in sorted(value, key=repr)]}
        if kind in (dict, MappingProxyType):
            pairs = [[self.value(key), self.value(own)] for key, own in value.items()]
            return {"dict" if kind is dict else "read_only": pairs}
        if id(value) not in self._known:
            self._known[id(value)] = value, self._thing(value)
        return self._known[id(value)][1]

    def _thing(self, value: Any) -> Reference:
        if isinstance(value, enum.Enum):
            return {"enum": [self._class(type(value)), value.name]}
        if isinstance(value, np.ndarray | np.generic | jax.Array):
            return self._array(value)
        if isinstance(value, pd.DataFrame):
            return self._table(value)
        if isinstance(value, type) or callable(value) and not dataclasses.is_dataclass(value):
            return {"name": self._name(value)}
        return self._object(value)

    def _array(self, value: Any) -> Reference:
        kind = "scalar" if isinstance(value, np.generic) else "numpy" if isinstance(value, np.ndarray) else "jax"
        values = np.asarray(value)
        if values.dtype.hasobject:
            raise StoredError("it holds an array of Python objects, which no file can hold safely; make it numbers")
        held = io.BytesIO()
        np.save(held, values, allow_pickle=False)
        return {kind: self._file("array", "npy", held.getvalue())}

    def _table(self, value: pd.DataFrame) -> Reference:
        held = io.BytesIO()
        try:
            value.to_parquet(held)
        except (ValueError, TypeError) as error:  # pyarrow's errors are both
            raise StoredError(
                f"it holds a table that Parquet cannot ({str(error).splitlines()[0]:.80}); give it columns of numbers or words"
            ) from None
        return {"table": self._file("table", "parquet", held.getvalue())}

    def _file(self, kind: str, ending: str, data: bytes) -> str:
        name = f"{kind}s/{len(self.files)}.{ending}"
        self.files[name] = data
        return name

    def _object(self, value: Any) -> Reference:
        of = type(value)
        if of in _AS_ONE:
            fields = {"": self.value(_AS_ONE[of](value))}
        elif dataclasses.is_dataclass(value):
            if isinstance(value, Origin):
                kept = {name: own for name, own in value.arguments.items() if _can_be_written(own)}
                value = dataclasses.replace(value, arguments=kept)
            fields = {f.name: self.value(getattr(value, f.name)) for f in dataclasses.fields(value)}
        elif isinstance(value, tuple) and hasattr(value, "_fields"):
            fields = {name: self.value(own) for name, own in value._asdict().items()}  # type: ignore[attr-defined]
        else:
            raise StoredError(f"it holds a {of.__name__} ({name_of(of)}), which is no result and no dataclass")
        self.objects.append({"class": self._class(of), "fields": fields})
        return {"object": len(self.objects) - 1}

    def _class(self, of: type) -> str:
        return self._name(of)

    def _name(self, thing: Any) -> str:
        found = getattr(thing, "__module__", None), getattr(thing, "__qualname__", None)
        if None in found or _attribute(sys.modules.get(str(found[0])), str(found[1])) is not thing:
            called = getattr(thing, "__qualname__", None) or type(thing).__name__
            raise StoredError(
                f"it holds {called!r}, which no other program could find by its name; define it at the top of a module, "
                "by def or class"
            )
        return name_of(thing)


def _can_be_written(value: Any) -> bool:
    """Whether a value can be: of an argument that cannot (a loss made of a lambda) a result is not to be lost."""
    try:
        Writer().value(value)
    except StoredError:
        return False
    return True


def _attribute(module: Any, qualname: str) -> Any:
    """What stands under a dotted name in a module; None where nothing does."""
    found = module
    for part in qualname.split("."):
        found = vars(found).get(part) if isinstance(found, ModuleType | type) else None
    return found


# -- reading -----------------------------------------------------------------------------------------------------------
class Reader:
    """Puts values together again. `known`: modules, classes and functions that the user handed over."""

    def __init__(self, objects: list[dict[str, Any]], files: Mapping[str, bytes], known: tuple[Any, ...] = ()):
        self._files, self._known = files, known
        self._arrays: dict[str, Any] = {}
        self._objects: list[Any] = []
        for entry in objects:  # in the order in which they refer to one another
            self._objects.append(self._object(entry["class"], entry["fields"]))

    def value(self, value: Any) -> Any:
        """The value that JSON's `value` stands for."""
        if isinstance(value, list):
            return [self.value(own) for own in value]
        if not isinstance(value, dict):
            return value
        ((kind, held),) = value.items()
        return getattr(self, f"_{kind}_of")(held)

    def _float_of(self, held: str) -> float:
        return float(held)

    def _tuple_of(self, held: list[Any]) -> tuple[Any, ...]:
        return tuple(map(self.value, held))

    def _set_of(self, held: list[Any]) -> set[Any]:
        return set(map(self.value, held))

    def _frozenset_of(self, held: list[Any]) -> frozenset[Any]:
        return frozenset(map(self.value, held))

    def _dict_of(self, held: list[Any]) -> dict[Any, Any]:
        return {self.value(key): self.value(own) for key, own in held}

    def _read_only_of(self, held: list[Any]) -> MappingProxyType[Any, Any]:
        return MappingProxyType(self._dict_of(held))

    def _object_of(self, held: int) -> Any:
        return self._objects[held]

    def _enum_of(self, held: list[str]) -> Any:
        return self._class(held[0])[held[1]]

    def _name_of(self, held: str) -> Any:
        return self._found(held)

    def _numpy_of(self, held: str) -> np.ndarray:
        if held not in self._arrays:
            self._arrays[held] = np.load(io.BytesIO(self._files[held]), allow_pickle=False)
        return self._arrays[held]

    def _scalar_of(self, held: str) -> Any:
        return self._numpy_of(held)[()]

    def _jax_of(self, held: str) -> jax.Array:
        with jax.enable_x64(True):
            return jax.numpy.asarray(self._numpy_of(held))

    def _table_of(self, held: str) -> pd.DataFrame:
        return pd.read_parquet(io.BytesIO(self._files[held]))

    def _object(self, name: str, fields: dict[str, Any]) -> Any:
        of: Any = self._class(name)
        own = {field: self.value(value) for field, value in fields.items()}
        if of in _AS_ONE:
            return of(own[""])
        if issubclass(of, tuple):
            return of(**own)
        made = {field.name: field.init for field in dataclasses.fields(of)}
        strange = next((field for field in own if field not in made), None)
        if strange is not None:
            raise StoredError(f"has a {name} with {strange!r}, which this version's has not")
        found = of(**{field: value for field, value in own.items() if made[field]})
        for field in (field for field in own if not made[field]):
            object.__setattr__(found, field, own[field])
        return found

    def _class(self, name: str) -> Any:
        found = self._found(name)
        if not isinstance(found, type):
            raise StoredError(f"takes {name} for a class, which it is not")
        return found

    def _found(self, name: str) -> Any:
        """A class or function by its name, among what is imported or handed over."""
        module, _, qualname = name.partition(":")
        for given in self._known:
            if isinstance(given, ModuleType):
                same = module in (given.__name__, "__main__")
                found = _attribute(given, qualname) if same else None
            else:
                own = (getattr(given, "__module__", None), getattr(given, "__qualname__", None))
                found = given if own[1] == qualname and module in (own[0], "__main__") else None
            if found is not None:
                return found
        found = _attribute(sys.modules.get(module), qualname)
        if found is None and module.split(".")[0] == "jaxid":
            raise StoredError(f"holds a {name}, which this version has not (or not yet imported)")
        if found is None:
            raise StoredError(
                f"needs {name}, which is not imported; import {module} first, or hand it over: jaxid.load(path, known=[...])"
            )
        if not _allowed(found, module, qualname):
            raise StoredError(f"names {name}, which is no part of a robot or of a result")
        return found


def _allowed(found: Any, module: str, qualname: str) -> bool:
    """Whether a file may name it: a class of jaxid's or derived from one, or a plain function of a user's module.

    What a robot's functions are is called with the robot's states, so a file must not choose among functions of Python's own
    library or of jaxid's commands.
    """
    if (getattr(found, "__module__", None), getattr(found, "__qualname__", None)) != (module, qualname):
        return False
    top = module.split(".")[0]
    if isinstance(found, type):
        bases = [base for base in found.__mro__ if base.__module__.split(".")[0] == "jaxid"]
        return bool(bases) and (
            dataclasses.is_dataclass(found) or issubclass(found, tuple | enum.Enum) or found in _AS_ONE
        )
    if top == "jaxid" and module.split(".")[1:2] not in (["robots"], ["effects"], ["papers"]):
        return False
    return isinstance(inspect.unwrap(found), FunctionType) and top not in sys.stdlib_module_names
