"""What the design of experiments returns: inputs to drive and what they are worth."""

import html
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .._atomic import replacing
from .._origin import Origin
from ..estimate.uncertainty import PRACTICAL
from ..logs import Channels, Log, LogSet

Array = NDArray[np.float64]
_NO_DIFFERENCE = 1.05
"""Ratio of two widths of intervals below which they are as good as the same."""


@dataclass(frozen=True, repr=False)
class PlannedRun:
    """One experiment to drive, from rest.

    `time` [T] s, `inputs` [T, nu] held from one sample to the next, `outputs` [T, ny] to expect of all measured channels,
    `path` [T, 2] m where the robot's path is known. `limited_by` says which limits it uses up.
    """

    name: str
    description: str
    time: Array
    inputs: Array
    outputs: Array
    path: Array | None
    channels: Channels
    limited_by: tuple[str, ...]

    @property
    def energy(self) -> float:
        """Integral of the squared inputs, all together [unit² s]."""
        return float(np.sum(self.inputs**2) * (self.time[1] - self.time[0]))

    @property
    def log(self) -> Log:
        """The inputs with the outputs to expect, as if it had been recorded without noise."""
        return Log.from_arrays(self.name, self.time, self.inputs, self.outputs, self.channels)

    def save(self, path: str | Path, *, expected: bool = False) -> None:
        """Write a log with time and inputs, ready for the columns that the sensors fill.

        `expected` adds the expected outputs, so that `read_logs` takes the file as it is: for simulations, not to be fitted.
        Raises `OSError` if the file cannot be written.
        """
        columns = {"t": self.time, **dict(zip(self.channels.inputs, self.inputs.T, strict=True))}
        if expected:
            columns |= dict(zip(self.channels.measured, self.outputs.T, strict=True))
        with replacing(path) as temporary:
            pd.DataFrame(columns).to_csv(temporary, index=False, float_format="%.6g", lineterminator="\n")

    def __repr__(self) -> str:
        bounds = "; ".join(self.limited_by) or "no limit is used up, a longer run would tell more"
        return f"{self.name}: {len(self.time) * self.time[1]:.3g} s, {self.description}. Limits: {bounds}."


@dataclass(frozen=True, repr=False)
class Design:
    """Experiments to drive and what to expect of them.

    - `runs`: what to drive, best first.
    - `values` and `units` of the free parameters; `std_errors`: those expected of output error once the runs are recorded,
      together with what was known before; `reference_std_errors`: the same for the PRBS that `reference` describes, of the
      same length and energy; `before`: with what was known before alone.
    - `magnitudes`: the parameters' orders of magnitude, beside which an error counts as large.
    - `tried`: how many inputs were simulated.
    - `meanings`: what the parameters stand for.
    - `doubt`: why the model that was designed for may not be the robot's, empty if nothing says so.
    """

    robot: str
    runs: tuple[PlannedRun, ...]
    values: dict[str, float]
    units: dict[str, str]
    magnitudes: dict[str, float]
    std_errors: dict[str, float]
    reference: str
    reference_runs: tuple[PlannedRun, ...]
    reference_std_errors: dict[str, float]
    before: dict[str, float]
    tried: int
    doubt: str = ""
    meanings: dict[str, str] = field(default_factory=dict)
    origin: Origin | None = field(default=None, kw_only=True, compare=False, repr=False)

    @property
    def ratios(self) -> dict[str, float]:
        """Width of each parameter's interval over that with the reference."""
        return {name: error / self.reference_std_errors[name] for name, error in self.std_errors.items()}

    @property
    def gain(self) -> float:
        """Geometric mean of `ratios`: below one, the design is better."""
        return float(np.exp(np.mean(np.log(list(self.ratios.values())))))

    @property
    def log(self) -> Log:
        """The first run with its expected outputs."""
        return self.runs[0].log

    @property
    def logs(self) -> LogSet:
        """All runs with their expected outputs."""
        return LogSet(run.log for run in self.runs)

    def save(self, path: str | Path, *, expected: bool = False) -> list[Path]:
        """Write one CSV file per run (`PlannedRun.save`): `path` itself for one, otherwise path_1.csv, path_2.csv …"""
        path = Path(path)
        several = [path.with_name(f"{path.stem}_{i}{path.suffix}") for i in range(1, len(self.runs) + 1)]
        paths = [path] if len(self.runs) == 1 else several
        for run, file in zip(self.runs, paths, strict=True):
            run.save(file, expected=expected)
        return paths

    def _share(self, name: str, error: float) -> str:
        magnitude = self.magnitudes[name]
        if error > PRACTICAL * magnitude:
            return "not determined"
        # Nothing is a share of zero.
        return f"{100 * error / magnitude:.2g} %" if self.values[name] else f"{error:.2g} {self.units[name]}".rstrip()

    @property
    def sentence(self) -> str:
        """What the design is worth."""
        worst = max(self.ratios, key=lambda name: self.ratios[name])
        change = f"{'narrower' if self.gain < 1 else 'wider'} by a factor of {max(self.gain, 1 / self.gain):.1f}"
        change = "no difference that counts" if max(self.gain, 1 / self.gain) < _NO_DIFFERENCE else change
        return (
            f"Intervals are {self.gain:.2f} times as wide as with {self.reference} (geometric mean over {len(self.values)} "
            f"parameters; {worst} fares worst with {self.ratios[worst]:.2f}): {change}. "
            f"{self.doubt}"
        ).rstrip()

    def _rows(self) -> list[tuple[str, str, str, str, str]]:
        return [
            (
                name,
                f"{value:.4g} {self.units[name]}".rstrip(),
                self._share(name, self.std_errors[name]),
                self._share(name, self.reference_std_errors[name]),
                f"{self.ratios[name]:.2f}",
            )
            for name, value in self.values.items()
        ]

    def __repr__(self) -> str:
        head = ("", "value", "std error", "with PRBS", "ratio")
        rows = [head, *self._rows()]
        widths = [max(len(row[i]) for row in rows) for i in range(5)]
        table = ["  " + "  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)) for row in rows]
        lines = [f"Drive the {self.robot}, {self.tried} inputs tried:", *map(repr, self.runs), self.sentence, *table]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        runs = "".join(f"<li>{html.escape(repr(run))}</li>" for run in self.runs)
        head = "".join(f"<th>{t}</th>" for t in ("", "value", "expected standard error", "with PRBS", "ratio"))
        rows = "".join(
            "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in self._rows()
        )
        return f"<p>{html.escape(self.sentence)}</p><ul>{runs}</ul><table><tr>{head}</tr>{rows}</table>"
