"""MATLAB files (.mat), by SciPy, or h5py for version 7.3: vectors, structs of vectors, and structures with time.

- Vectors of one length, at the top or in a struct, with a time among them (`t`, `time`, `Time`, `tout`, in another unit `t_ms`,
  or one that a mapping names, of every struct that has it): `V2`, or `run.V2` in a struct called run.
- Simulink's "structure with time": `out.time` with `out.signals(k).values` and `.label`: `out.label`.

Timetables and timeseries are objects of MATLAB's own, which no other program reads; as structs they can be saved.
"""

from pathlib import Path
from typing import Any

import numpy as np

from ..finding import LogError
from ..series import Recording, Series, Topic, nanoseconds
from ..times import seconds_in_name
from . import matlab73

TIMES = ("t", "time", "Time", "tout", "timestamp", "t_s", "time_s", "seconds")
"""What a column of times is usually called."""
_AS_STRUCT = "save it as a struct of vectors: s = struct('t', seconds(T.Time), 'V2', T.V2); save('run.mat', 's', '-v7')"


def _vectors(name: str, value: Any) -> dict[str, Any]:
    """Columns of numbers below a variable, by path."""
    if isinstance(value, dict):
        found: dict[str, Any] = {}
        signals = value.get("signals")
        if "time" in value and isinstance(signals, dict | list):
            found[f"{name}.time"] = np.asarray(value["time"], dtype=float)
            each = [signals] if isinstance(signals, dict) else signals
            for number, one in enumerate(each):
                label = one.get("label") if isinstance(one, dict) else None
                label = label if isinstance(label, str) and label else f"signals[{number}]"
                found |= _vectors(f"{name}.{label}", one.get("values") if isinstance(one, dict) else None)
            return found
        for field, inner in value.items():
            found |= _vectors(f"{name}.{field}", inner)
        return found
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf" or value.ndim > 2:
        return {}
    if value.ndim == 2:
        tall = value if value.shape[0] >= value.shape[1] else value.T
        return {f"{name}[{k}]": tall[:, k].astype(float) for k in range(tall.shape[1])} if tall.shape[1] <= 32 else {}
    return {name: value.astype(float)} if value.ndim == 1 else {}


def _opaque(path: Path) -> list[str]:
    """Variables that are objects of MATLAB's own, such as timetables."""
    import scipy.io

    try:
        return [str(name) for name, _, kind in scipy.io.whosmat(path) if kind in ("opaque", "object", "function")]
    except Exception:  # what SciPy stumbles over there has been said by reading the file itself
        return []


def _loaded(path: Path) -> dict[str, Any]:
    import scipy.io

    try:
        data = path.read_bytes()[:128]
        if data[:4] == b"\x89HDF" or b"MATLAB 7.3" in data:
            return matlab73.load(path)
        return scipy.io.loadmat(path, simplify_cells=True)
    except LogError:
        raise
    except PermissionError as error:
        raise LogError(f"{path} cannot be opened ({error.strerror}); check its permissions.") from None
    except Exception as error:  # of damaged bytes SciPy raises whatever its parts raise
        cause = " ".join("".join(c if c.isprintable() else " " for c in str(error)).split())[:120].rstrip(".")
        raise LogError(
            f"{path} cannot be read as a MATLAB file ({cause or type(error).__name__}); save it again."
        ) from None


def read_mat(path: Path, time_field: str | None = None) -> Recording:
    """The vectors of a MATLAB file, each with the times that stand beside it; `time_field` names these.

    Raises `LogError`, one sentence with file and remedy, for a file of version 7.3 without h5py, one that is damaged, and one
    without vectors beside a time.
    """
    loaded = {name: value for name, value in _loaded(path).items() if not name.startswith("__")}
    vectors = {name: column for top, value in loaded.items() for name, column in _vectors(top, value).items()}
    times = {name: v * _factor(name, time_field) for name, v in vectors.items() if _is_time(name, time_field)}
    series: dict[str, Series] = {}
    topics: dict[str, Topic] = {}
    for name, values in vectors.items():
        called = (*([time_field] if time_field else []), *TIMES, *{_last(time) for time in times})
        near = (time_field, *(f"{_group(name)}{time}" for time in called), *called)
        own = next((time for time in near if _beside(time, values, times)), None)
        if name in times or own is None:
            continue
        try:
            received = nanoseconds(times[own])
        except ValueError as error:
            raise LogError(f"{path}: {own!r} {error}; give seconds.") from None
        series[name] = Series(name, own, values, received)
        topics[own] = Topic(own, f"MATLAB vectors beside {own}", len(values))
    if not series:
        opaque = _opaque(path)
        if opaque:
            raise LogError(f"{path} holds {opaque[0]!r}, an object that only MATLAB reads; {_AS_STRUCT}.")
        listed = ", ".join(f"{name} ({len(values)})" for name, values in vectors.items()) or "no vectors of numbers"
        raise LogError(
            f"{path} has no vectors with a time of their length beside them (it has {listed:.200}); save one called t, in "
            'seconds, or name yours in the mapping, such as t = { field = "clock_ms", scale = 0.001 }.'
        )
    return Recording(series, topics)


def _group(name: str) -> str:
    """The struct that a path is in, with its dot."""
    return name[: name.rfind(".") + 1]


def _last(name: str) -> str:
    """A variable's or a field's own name."""
    return name[name.rfind(".") + 1 :]


def _is_time(name: str, time_field: str | None) -> bool:
    """Whether a vector is one of times: the named one, or one of its name in another struct; or one that is called so."""
    return time_field in (name, _last(name)) or _last(name) in TIMES or seconds_in_name(_last(name)) is not None


def _factor(name: str, time_field: str | None) -> float:
    """What makes seconds of times; 1 of those that a mapping names, which has their scale."""
    return 1.0 if time_field in (name, _last(name)) else seconds_in_name(_last(name)) or 1.0


def _beside(time: str | None, values: np.ndarray, times: dict[str, np.ndarray]) -> bool:
    return time in times and len(times[time]) == len(values) > 1
