"""A log: what one experiment recorded, on the host, as read-only NumPy arrays; and a set of logs of one robot.

Row k holds what was measured at t_k and the input applied from t_k to t_(k+1) (zero-order hold).
"""

import html
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import pandas as pd
from jaxtyping import Float
from numpy.typing import ArrayLike, NDArray

from .._renamed import renamed
from .channels import Channels
from .content_hash import content_hash
from .dataset import log_dataset
from .finding import SILENT_COMMAND, Finding, LogError, LogWarning, did_you_mean
from .times import unit_doubt

if TYPE_CHECKING:
    import xarray

    from .batch import Batch

Array = NDArray[np.float64]

ABSURD = 1e12
"""No input, output or pose in SI units is larger."""
_SECONDS = (1e-9, 100.0)
"""A sampling interval outside is none of a robot, and a simulation that steps through it would not end."""


def _read_only(values: ArrayLike) -> Array:
    array = np.array(values, dtype=float)
    array.flags.writeable = False
    return array


def _columns(values: ArrayLike | Mapping[str, ArrayLike], names: Sequence[str], samples: int, what: str) -> Array:
    """`[T, len(names)]` from a mapping or an array; trailing columns that are missing become NaN."""
    if isinstance(values, Mapping):
        unknown = [name for name in values if name not in names]
        if unknown:
            raise LogError(f"{what} has a channel {unknown[0]!r} that the robot lacks; use {list(names)}.")
        absent = np.full(samples, np.nan)
        values = np.stack([np.asarray(values.get(name, absent), dtype=float) for name in names], axis=-1)
    array = np.asarray(values, dtype=float)
    array = array[:, None] if array.ndim == 1 else array
    if array.ndim != 2 or array.shape[0] != samples or array.shape[1] > len(names):
        raise LogError(
            f"{what} has shape {array.shape} where [{samples}, {len(names)}] is needed; give one row for each time and "
            f"one column for each of {list(names)}."
        )
    missing = np.full((samples, len(names) - array.shape[1]), np.nan)
    return np.concatenate([array, missing], axis=1)


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """One experiment.

    **Fields:**

    - `name`: the file's name, such as `"turns.csv"`.
    - `time`: `[T]` s, strictly increasing.
    - `inputs`: `[T, nu]`, row k applied from t_k to t_(k+1); finite.
    - `outputs`: `[T, ny]`, the channels' outputs and then their optional outputs; NaN where nothing was measured, a
      channel that the log lacks being NaN throughout.
    - `channels`: names and units of those columns.
    - `extra`: every other column of the file, unchanged (pose columns `x, y, theta, beta` give the initial pose).
    - `source`: the path it was read from, or "".
    - `findings`: what the reader noticed and had to decide; pre-flight repeats it.
    - `cut`: whether it is a window of a longer log, whose initial state is estimated whatever its first sample shows.

    Raises `LogError` for fewer than two rows, wrong shapes, a time that is not finite and strictly increasing or whose
    unit cannot be told, an input that is not finite, infinite outputs, numbers beyond 1e12, and an output (without
    substitute) that was never measured.
    """

    name: str
    time: Float[np.ndarray, " T"]
    inputs: Float[np.ndarray, "T nu"]
    outputs: Float[np.ndarray, "T ny"]
    channels: Channels
    extra: pd.DataFrame = field(default_factory=pd.DataFrame)
    source: str = ""
    findings: tuple[Finding, ...] = ()
    cut: bool = False

    def __post_init__(self) -> None:
        time = _read_only(self.time)
        if time.ndim != 1:
            raise LogError(f"{self.name}: time has shape {time.shape}; give a vector of seconds.")
        if len(time) < 2:
            raise LogError(f"{self.name} holds {len(time)} row(s); a log needs at least two samples of an experiment.")
        bad = np.flatnonzero(~np.isfinite(time))
        if len(bad):
            raise LogError(f"{self.name}: column 't' has no time at sample {bad[0]}; fill in or remove that row.")
        bad = np.flatnonzero(np.diff(time) <= 0)
        if len(bad):
            k = int(bad[0]) + 1
            kind = "repeats the previous time" if time[k] == time[k - 1] else "runs backwards"
            raise LogError(
                f"{self.name}: column 't' {kind} at sample {k} ({time[k - 1]:.6g} s, then {time[k]:.6g} s; {len(bad)} "
                "such place(s)); cut the file there if the clock restarted, or map t = {interval = seconds} if the "
                "rows are evenly spaced and only their stamps are coarse."
            )
        interval = float(np.median(np.diff(time)))
        if not (_SECONDS[0] <= interval <= _SECONDS[1] and np.abs(time).max() < 1e20):
            raise LogError(
                f"{self.name}: column 't' has a sampling interval of {interval:.4g} s and ends at {time[-1]:.4g} s, which "
                "no recorder does; map t with the scale that gives seconds."
            )
        channels = self.channels
        inputs = _read_only(_columns(self.inputs, channels.inputs, len(time), f"{self.name}: inputs"))
        outputs = _read_only(_columns(self.outputs, channels.measured, len(time), f"{self.name}: outputs"))
        rows, columns = np.nonzero(~(np.abs(inputs) <= ABSURD))
        if len(rows):
            k, j = rows[0], columns[0]
            what = f"{inputs[k, j]:.4g}" if np.isfinite(inputs[k, j]) else "not a finite number"
            raise LogError(
                f"{self.name}: input {channels.inputs[j]!r} is {what} at sample {k}; fill in the command that was "
                "applied, or cut the log there."
            )
        absurd = np.argwhere(np.abs(outputs) > ABSURD)
        if len(absurd):
            k, j = absurd[0]
            what = f"{outputs[k, j]:.4g}" if np.isfinite(outputs[k, j]) else "infinite"
            raise LogError(
                f"{self.name}: output {channels.measured[j]!r} is {what} at sample {k}; use NaN for 'not measured'."
            )
        there = {n for n, column in zip(channels.measured, outputs.T, strict=True) if np.isfinite(column).any()}
        for name in channels.outputs:
            if name not in there and not channels.stood_in(name, there):
                own = channels.stand_ins(name)
                remedy = f" (or {' and '.join(map(repr, own))})" if own else ""
                raise LogError(f"{self.name}: output {name!r} has no measured value; give a log that has it{remedy}.")
        if len(self.extra.columns) and len(self.extra) != len(time):
            raise LogError(f"{self.name}: extra has {len(self.extra)} rows for {len(time)} samples; give one each.")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "inputs", inputs)
        object.__setattr__(self, "outputs", outputs)
        object.__setattr__(self, "extra", self.extra.reset_index(drop=True))
        object.__setattr__(self, "findings", tuple(self.findings))

    @classmethod
    def from_arrays(
        cls,
        name: str,
        time: ArrayLike,
        inputs: ArrayLike | Mapping[str, ArrayLike],
        outputs: ArrayLike | Mapping[str, ArrayLike],
        channels: Channels | Any,
        extra: pd.DataFrame | Mapping[str, ArrayLike] | None = None,
        source: str = "",
    ) -> "Log":
        """A log from arrays or from `{channel: values}` mappings.

        `inputs` is `[T, nu]`; `outputs` is `[T, n]` with the outputs first (missing optional columns become NaN);
        `channels` is a `Channels`, a robot that has one, or a robot's name. Raises `LogError` as `Log` does, and warns
        (`LogWarning`) of times that are hardly seconds: nothing that follows could tell, since every time constant would be
        wrong alike.

        >>> import jaxid
        >>> t = [0.0, 0.02, 0.04, 0.06]
        >>> log = jaxid.Log.from_arrays("push", t, {"u": [1, 1, 1, 0]}, {"v": [0.0, 0.01, 0.02, 0.03]}, "axis")
        >>> len(log), log.duration
        (4, 0.06)
        """
        channels = channels_of(channels)
        time = np.asarray(time, dtype=float)
        inputs = _columns(inputs, channels.inputs, len(time), f"{name}: inputs")
        outputs = _columns(outputs, channels.measured, len(time), f"{name}: outputs")
        log = cls(
            name, time, inputs, outputs, channels, pd.DataFrame() if extra is None else pd.DataFrame(extra), source
        )
        if doubt := unit_doubt(log.time):
            warnings.warn(f"{name}: column 't': {doubt}; give seconds.", LogWarning, stacklevel=2)
        return log

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        return (
            f"Log({self.name!r}: {len(self)} samples, {self.duration:.4g} s at {self.sampling_interval:.4g} s; inputs "
            f"{', '.join(self.channels.inputs)}; outputs {', '.join(self.measured)})"
        )

    @property
    def measured(self) -> tuple[str, ...]:
        """Names of the outputs that this log has, those never measured left out."""
        there = np.asarray(np.isfinite(self.outputs).any(axis=0))
        return tuple(name for j, name in enumerate(self.channels.measured) if there.item(j))

    @property
    def sampling_interval(self) -> float:
        """Median time from one sample to the next [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.time[-1] - self.time[0])

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the content (`content_hash`): logs of one hash give the same estimates."""
        return content_hash(self)

    def input(self, name: str) -> Float[np.ndarray, " T"]:
        """One input channel, `[T]`; raises `LogError` for an unknown name."""
        return self.inputs[:, self._index(name, self.channels.inputs, "input")]

    def output(self, name: str) -> Float[np.ndarray, " T"]:
        """One measured channel, `[T]`, NaN where not measured; raises `LogError` for an unknown name."""
        return self.outputs[:, self._index(name, self.channels.measured, "output")]

    def _index(self, name: str, names: tuple[str, ...], what: str) -> int:
        if name not in names:
            raise LogError(f"{self.name} has no {what} {name!r}{did_you_mean(name, names)}; use one of {list(names)}.")
        return names.index(name)

    def window(self, start: float | None = None, stop: float | None = None) -> "Log":
        """The samples with start <= t < stop [s, the log's own time]; raises `LogError` if fewer than two remain.

        Where it begins later than the log it is `cut`: it may begin in motion, whatever a late sensor's first sample shows.
        """
        start = -np.inf if start is None else start
        stop = np.inf if stop is None else stop
        rows = np.flatnonzero((self.time >= start) & (self.time < stop))
        if len(rows) < 2:
            raise LogError(
                f"{self.name}: the window from {start:.6g} to {stop:.6g} s holds {len(rows)} sample(s); the log runs "
                f"from {self.time[0]:.6g} to {self.time[-1]:.6g} s."
            )
        first, last = int(rows[0]), int(rows[-1]) + 1
        name = f"{self.name}[{self.time[first]:.6g}:{self.time[last - 1]:.6g}]"
        findings = [
            replace(finding, file=name, sample=None if finding.sample is None else finding.sample - first)
            for finding in self.findings
            if finding.sample is None or first + (finding.check == SILENT_COMMAND) <= finding.sample < last
        ]
        return Log(
            name,
            self.time[first:last],
            self.inputs[first:last],
            self.outputs[first:last],
            self.channels,
            self.extra.iloc[first:last],
            self.source,
            tuple(findings),
            cut=self.cut or first > 0,
        )

    def to_frame(self) -> pd.DataFrame:
        """`t`, the inputs, the measured outputs and the extra columns, one row a sample."""
        columns = {"t": self.time} | {name: self.input(name) for name in self.channels.inputs}
        columns |= {name: self.output(name) for name in self.measured}
        frame = pd.DataFrame(columns)
        return pd.concat([frame, self.extra], axis=1) if len(self.extra.columns) else frame

    def to_xarray(self) -> "xarray.Dataset":
        """The columns of `to_frame` over `t`, the channels with their units as attributes (`log_dataset`)."""
        return log_dataset(self)

    def to_csv(self, path: str | Path) -> None:
        """Write `to_frame` as CSV that `read_logs` reads back to the same numbers (shortest exact decimals)."""
        self.to_frame().to_csv(path, index=False)


def channels_of(robot: Any) -> Channels:
    """The `Channels` of a robot: given as such, as an object with `.channels`, or by a name, such as "pioneer"."""
    from .channels import STANDARD as known

    if isinstance(robot, str):
        if robot not in known:
            raise LogError(f"There is no robot {robot!r}{did_you_mean(robot, known)}; use one of {list(known)}.")
        return known[robot]
    channels = getattr(robot, "channels", robot)
    if isinstance(robot, type) and not isinstance(channels, Channels):
        raise LogError(f"{robot.__name__} is a class; give a robot of it, such as {robot.__name__}().")
    if not isinstance(channels, Channels):
        raise LogError(f"{robot!r} has no channels; give a robot's name, a Channels, or a robot with `.channels`.")
    return channels


_Look = Callable[[Log], list[Finding]]
_Among = Callable[[Sequence[Log], Sequence[Sequence[Finding]]], Iterable[Finding]]
_looks: list[tuple[_Look, _Among]] = []


def look_with(look: _Look, among: _Among) -> None:
    """Look at logs before fitting with `look`, and at what it finds in each of a set with `among`. The package `checks`
    calls this, so that logs do not depend on it."""
    _looks[:] = [(look, among)]


class LogSet(Sequence[Log]):
    """An immutable sequence of logs of one robot, each with its own name.

    Index it with a number, a slice (a `LogSet`) or a log's name. Raises `LogError` if it would be empty, if two logs
    share a name, or if their channels differ, `TypeError` for what is no log.
    """

    def __init__(self, logs: Iterable[Log]):
        self._logs = tuple(logs)
        if not self._logs:
            raise LogError("There are no logs here; give at least one.")
        for place, log in enumerate(self._logs):
            if not isinstance(log, Log):
                raise TypeError(
                    f"place {place} of the logs has a {type(log).__name__}, no Log; make one of its columns with "
                    "Log.from_arrays(name, time, inputs, outputs, robot)"
                )
        names = [log.name for log in self._logs]
        for log in self._logs:
            if names.count(log.name) > 1:
                raise LogError(f"Two logs are called {log.name!r}; give each its own name.")
            if log.channels != self._logs[0].channels:
                raise LogError(
                    f"{log.name} has the channels {list(log.channels)} and {self._logs[0].name} has "
                    f"{list(self._logs[0].channels)}; put logs of different robots into different sets."
                )

    @property
    def channels(self) -> Channels:
        """The channels that all logs share."""
        return self._logs[0].channels

    @property
    def names(self) -> tuple[str, ...]:
        """The logs' names, in order."""
        return tuple(log.name for log in self._logs)

    def __len__(self) -> int:
        return len(self._logs)

    def __iter__(self) -> Iterator[Log]:
        return iter(self._logs)

    @overload
    def __getitem__(self, key: int | str) -> Log: ...
    @overload
    def __getitem__(self, key: slice) -> "LogSet": ...
    def __getitem__(self, key: int | str | slice) -> "Log | LogSet":
        if isinstance(key, slice):
            return LogSet(self._logs[key])
        if isinstance(key, str):
            return self._logs[self._position(key)]
        return self._logs[key]

    def _position(self, key: int | str) -> int:
        if isinstance(key, str):
            if key not in self.names:
                raise LogError(f"There is no log {key!r}{did_you_mean(key, self.names)}; there are {list(self.names)}.")
            return self.names.index(key)
        if not -len(self) <= key < len(self):
            raise LogError(f"There is no log number {key}; there are {len(self)}: {list(self.names)}.")
        return range(len(self))[key]

    @renamed(check="held_out")
    def split(self, held_out: Sequence[str | int]) -> tuple["LogSet", "LogSet"]:
        """`(fit, held_out)`: the logs to identify from and those (by name or index) to judge the result on.

        Raises `LogError` for an unknown name, and if either part would be empty.

        >>> import jaxid
        >>> from jaxid import demo
        >>> logs = jaxid.read_logs(demo.folder("unknown") / "*.csv", robot="pioneer")
        >>> fit, held_out = logs.split(held_out=["check_1.csv", "check_2.csv", "check_3.csv"])
        >>> len(fit), len(held_out)
        (6, 3)
        """
        chosen = {self._position(key) for key in ([held_out] if isinstance(held_out, str | int) else held_out)}
        if not chosen or len(chosen) == len(self):
            part = "hold out" if not chosen else "fit"
            raise LogError(f"This split leaves no log to {part}; hold out some, not all, of {list(self.names)}.")
        fit = [log for position, log in enumerate(self._logs) if position not in chosen]
        return LogSet(fit), LogSet(self._logs[position] for position in sorted(chosen))

    def batch(self, multiple: int | None = None) -> "Batch":
        """All logs as padded JAX arrays; see `Batch.from_logs`."""
        from .batch import Batch

        return Batch.from_logs(self, multiple)

    @cached_property
    def _findings(self) -> tuple[Finding, ...]:
        if not _looks:
            import_module("jaxid.checks")  # found when first needed; it calls `look_with`
        ((look, among),) = _looks
        return tuple(among(self._logs, [look(log) for log in self._logs]))

    def preflight(self) -> list[Finding]:
        """What to know about these logs before fitting, log by log; see `jaxid.checks.preflight`.

        A sensor that does not answer in one log is no dead one where the others do not show it to answer to as little."""
        return list(self._findings)

    def _table(self) -> list[tuple[str, ...]]:
        def row(log: Log) -> tuple[str, ...]:
            doubts = [f.check for f in self._findings if f.file == log.name and f.severity != "note"]
            warnings = ", ".join(dict.fromkeys(doubts)) or "-"
            return log.name, str(len(log)), f"{log.duration:.4g}", f"{log.sampling_interval:.4g}", warnings

        return [("log", "samples", "seconds", "interval [s]", "warnings"), *map(row, self._logs)]

    def __repr__(self) -> str:
        table = self._table()
        widths = [max(len(row[column]) for row in table) for column in range(len(table[0]))]
        lines = [
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in table
        ]
        return "\n".join([f"LogSet of {len(self)} log{'s' * (len(self) != 1)}", *lines])

    def _repr_html_(self) -> str:
        head, *rows = [[html.escape(cell) for cell in row] for row in self._table()]
        header = "".join(f"<th>{cell}</th>" for cell in head)
        body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
        return f"<table><thead><tr>{header}</tr></thead><tbody>{body}</tbody></table>"
