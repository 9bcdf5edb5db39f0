"""One object that sets estimates side by side: parameters, and how well each model predicts held-out logs."""

import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from .._origin import Origin
from .._table import WIDTH, columns
from ..estimate.confidence.agreement import Agreement
from ..estimate.result import Estimate, Fit
from ..logs import LogSet
from . import tables as tab
from .tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TIE = 0.005  # normalised RMS values that print alike
_DOUBTS = {"failed": "failed (it does not follow its own logs)", "poor": "is poor (it leaves more than noise)"}
_SAME = 2.0  # combined standard errors within which two estimates agree
_DPI = 130
_ENDING, _UNFIT_FOR_A_FILE = re.compile(r"\.(csv|parquet)$"), re.compile(r"[^\w.-]+")


@dataclass(frozen=True, repr=False)
class Comparison:
    """Estimates side by side and their predictions of held-out logs; the last line of a cell shows it.

    - `fits`: by label (the method's name, numbered where several fits used the same).
    - `predicted`: by label, how the model predicts the held-out logs `logs`; `fitted`: the same of the logs that were
      fitted, where they were given.
    - `noise`: standard deviation of each channel's noise, from the held-out logs alone.
    - `reference`: "true" or "published", and `references`: those values by symbol.
    - `notes`: sentences that the user should read.
    - `ahead`: by label of the fits with process noise, how their filters predict the held-out logs that many samples ahead.
    """

    fits: dict[str, Fit]
    logs: LogSet
    noise: dict[str, float]
    predicted: dict[str, Agreement]
    fitted: dict[str, Agreement] = field(default_factory=dict)
    reference: str = "published"
    references: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    ahead: dict[str, dict[int, Agreement]] = field(default_factory=dict)
    origin: Origin | None = field(default=None, kw_only=True, compare=False, repr=False)

    @property
    def validations(self) -> dict[str, Agreement]:
        """`predicted` under its earlier name."""
        warnings.warn("Comparison.validations is now Comparison.predicted", DeprecationWarning, stacklevel=2)
        return self.predicted

    @property
    def tested(self) -> dict[str, Agreement]:
        """By method what is asked whether it leaves nothing but noise: a free simulation, of a fit with process noise what its
        filter predicts one sample ahead, since disturbances stay in every free simulation."""
        ahead = {label: min(own.items())[1] for label, own in self.ahead.items()}
        return {
            f"{label}_one_sample_ahead" if label in ahead else label: ahead.get(label, found)
            for label, found in self.predicted.items()
        }

    @property
    def channels(self) -> tuple[str, ...]:
        """The measured channels that the models are judged by."""
        return tuple(next(iter(self.predicted.values())).fit_percent)

    # -- numbers ---------------------------------------------------------------------------------------------------
    def _estimate(self, label: str, name: str) -> Estimate | None:
        """A method's estimate of a parameter or combination; None where its robot has no such thing."""
        fit = self.fits[label]
        return fit.parameters.get(name) or fit.combinations.get(name)

    def _value_of(self, label: str, name: str) -> float:
        found = self._estimate(label, name)
        return float("nan") if found is None else found.value

    @cached_property
    def _names(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Parameters worth a row (estimated, or not the same everywhere, or known to be otherwise); combinations."""
        fits = self.fits.values()
        everything = [name for fit in fits for name in fit.parameters]
        if self.reference == "true":
            everything += self.references
        combined = tuple(dict.fromkeys(name for fit in fits for name in fit.combinations))
        shown = []
        for name in dict.fromkeys(everything):
            values = [self._value_of(label, name) for label in self.fits]
            if self.reference == "true" and name in self.references:
                values.append(self.references[name])
            if any(name in fit.free_names for fit in fits) or not np.allclose(values, values[0], rtol=1e-9, atol=0):
                shown.append(name)
        return tuple(name for name in shown if name not in combined), combined

    @property
    def parameters(self) -> pd.DataFrame:
        """Parameters, then combinations: columns ("", unit), ("", true or published) and, by method, value, std_error,
        ci95_low, ci95_high, status and error_percent (of the reference)."""
        names, combined = self._names
        rows = []
        for name in names + combined:
            known = self.references.get(name, float("nan"))
            own = {label: self._estimate(label, name) for label in self.fits}
            row: dict[tuple[str, str], object] = {
                ("", "unit"): next((e.unit for e in own.values() if e and e.unit), ""),
                ("", self.reference): known,
            }
            for label, e in own.items():
                low, high = e.ci95 if e else (np.nan, np.nan)
                row |= {
                    (label, "value"): e.value if e else np.nan,
                    (label, "std_error"): e.std_error if e else np.nan,
                    (label, "ci95_low"): low,
                    (label, "ci95_high"): high,
                    (label, "status"): e.status if e else "absent",
                    (label, "error_percent"): 100.0 * (e.value - known) / abs(known) if e and known else np.nan,
                }
            rows.append(row)
        frame = pd.DataFrame(rows, index=pd.Index(names + combined, name="parameter"))
        frame.columns = pd.MultiIndex.from_tuples(list(frame.columns))
        return frame

    @property
    def held_out(self) -> pd.DataFrame:
        """By method: normalised_rms, fit_percent of each channel (`fit_percent eta1`), the residual's RMS, mean and std
        of each channel, and normalised_rms of each log."""
        rows = {}
        for label, v in self.predicted.items():
            row: dict[str, float] = {"normalised_rms": v.normalised_rms}
            if label in self.fitted:
                row["normalised_rms (fitted logs)"] = self.fitted[label].normalised_rms
            for what, values in (("fit_percent", v.fit_percent), ("rms", v.rms), ("mean", v.mean), ("std", v.std)):
                row |= {f"{what} {channel}": value for channel, value in values.items()}
            row |= {f"normalised_rms {name}": found.normalised_rms for name, found in v.by_log.items()}
            rows[label] = row
        return pd.DataFrame.from_dict(rows, orient="index").rename_axis("method")

    @property
    def tests(self) -> pd.DataFrame:
        """Every residual test: method, channel, test, statistic, p_value, rejected, sentence."""
        rows = [
            (label, channel, t.name, t.statistic, t.p_value, t.rejected, t.sentence)
            for label, v in self.predicted.items()
            for channel, tests in v.tests.items()
            for t in tests.all
        ]
        names = ["method", "channel", "test", "statistic", "p_value", "rejected", "sentence"]
        return pd.DataFrame(rows, columns=names)

    def _farthest(self, one: str, other: str) -> str:
        """The parameter on which two methods differ most, in words; it must have an interval in both."""
        distance = {}
        for name in (*self._names[0], *self._names[1]):
            a, b = self._estimate(one, name), self._estimate(other, name)
            if a is None or b is None or not a.status == b.status == "identified":
                continue
            spread = float(np.hypot(a.std_error, b.std_error))
            if np.isfinite(spread) and spread > 0:
                distance[name] = abs(a.value - b.value) / spread
        if not distance:
            return "no parameter is identified by both"
        name = max(distance, key=lambda n: distance[n])
        if distance[name] <= _SAME:
            return f"every parameter that both identify agrees within {_SAME:g} combined standard errors"
        a, b = self._value_of(one, name), self._value_of(other, name)
        unit, apart = f" {self.parameters.loc[name, ('', 'unit')]}".rstrip(), distance[name]
        who = "they" if len(self.fits) == 2 else "best and worst"
        return (
            f"{who} differ most in {name} ({tab.number(a)} against {tab.number(b)}{unit}, "
            f"{f'{apart:.1f}' if apart < 1e4 else f'{apart:.1e}'} combined standard errors)"
        )

    @property
    def sentence(self) -> str:
        """The verdict: how close each method predicts the held-out logs and where the methods differ."""
        clean = [label for label, v in self.predicted.items() if not v.diverged]
        failed = [label for label in self.predicted if label not in clean]
        clean.sort(key=lambda label: self.predicted[label].normalised_rms)
        parts = []
        if clean:
            level = {label: f"{self.predicted[label].normalised_rms:.2f}" for label in clean}
            best = clean[0]
            text = f"{tab.title_of(best)} predicts the held-out logs to {level[best]} times the noise (1 is the floor)"
            text += "".join(f", {tab.title_of(label)} to {level[label]} times" for label in clean[1:])
            if len(clean) > 1:
                gap = self.predicted[clean[-1]].normalised_rms - self.predicted[best].normalised_rms
                text += ", no difference that counts" if gap < _TIE else ""
                text += f"; {self._farthest(best, clean[-1])}"
            parts.append(text)
        for label in failed:
            names = self.predicted[label].diverged
            where = "every held-out log" if len(names) == len(self.logs) else ", ".join(names)
            parts.append(f"{tab.title_of(label)} diverges on {where}")
        for label, horizons in self.ahead.items():
            steps = min(horizons)
            words = "one sample" if steps == 1 else f"{steps} samples"
            parts.append(
                f"{tab.title_of(label)} foresees {words} ahead to {horizons[steps].normalised_rms:.2f} times the noise"
            )
        text = "; ".join(parts)
        # What is wrong with a fit comes before how well it predicts.
        verdicts = {label: fit.judgement.verdict for label, fit in self.fits.items() if fit.judgement}
        doubts = [f"the fit of {tab.title_of(n)} {_DOUBTS[v]}" for n, v in verdicts.items() if v in _DOUBTS]
        text = "; ".join([*doubts, text]) if doubts else text
        return f"{text[0].upper()}{text[1:]}."

    # -- tables ----------------------------------------------------------------------------------------------------
    def _unit(self, channel: str) -> str:
        return self.logs.channels.units.get(channel, "")

    @property
    def _doubtful(self) -> list[str]:
        return [label for label, fit in self.fits.items() if not fit.trustworthy]

    @property
    def tables(self) -> tuple[Table, ...]:
        """Prediction, logs, parameters, residual tests: `report.tables.to_text` renders them."""
        units = {channel: self._unit(channel) for channel in self.channels}
        names = (*self._names[0], *self._names[1])
        estimates = {label: {name: self._estimate(label, name) for name in names} for label in self.fits}
        return (
            tab.held_out_table(self.predicted, self.fitted, self.noise, units),
            tab.log_table(self.predicted),
            *([tab.ahead_table(self.ahead, self.predicted)] if self.ahead else []),
            *tab.parameter_tables(estimates, self.references, self.reference, self._doubtful),
            tab.test_table(self.tested),
        )

    def __repr__(self) -> str:
        # Up to three methods fit into a usual terminal; more need a wider one.
        width = max(columns(), WIDTH + 24 * (len(self.fits) - 3) if len(self.fits) > 3 else 0)
        return tab.to_text(self.tables, (self.sentence, *(f"Note: {note}" for note in self.notes)), width)

    # -- figures ---------------------------------------------------------------------------------------------------
    @property
    def worst_log(self) -> str:
        """The held-out log with the largest normalised RMS of any method; one that diverges comes first."""
        found = {log.name: [v.by_log[log.name] for v in self.predicted.values()] for log in self.logs}
        key = {n: max(np.inf if f.diverged else f.normalised_rms for f in own) for n, own in found.items()}
        return max(key, key=lambda name: key[name])

    @cached_property
    def _responses(self) -> dict[str, str]:
        """Name of each held-out log's figure."""
        found: dict[str, str] = {}
        for log in self.logs:
            short, whole = (_UNFIT_FOR_A_FILE.sub("_", x) for x in (_ENDING.sub("", log.name), log.name))
            found[log.name] = f"response_{whole if f'response_{short}' in found.values() else short}"
        return found

    @cached_property
    def _drawings(self) -> "dict[str, Callable[[], Figure]]":
        """How to draw each figure, by name."""
        from . import comparison_figures as draw  # and matplotlib with it, only where something is drawn

        found: dict[str, Callable[[], Figure]] = {
            name: partial(draw.held_out_response, self, log) for log, name in self._responses.items()
        }
        found |= {f"residuals_{channel}": partial(draw.channel_residuals, self, channel) for channel in self.channels}
        return found | {"parameters": partial(draw.ratios, self)}

    @cached_property
    def _drawn(self) -> dict[str, bytes]:
        return {}

    def _picture(self, name: str) -> bytes:
        """A figure as a PNG file's bytes, drawn once."""
        from .figures import as_png

        if name not in self._drawn:
            self._drawn[name] = as_png(self._drawings[name](), _DPI)
        return self._drawn[name]

    def figures(self) -> "dict[str, Figure]":
        """Figures by name: `response_<log>` of every held-out log, `residuals_<channel>`, `parameters`."""
        return {name: drawn() for name, drawn in self._drawings.items()}

    def save(self, folder: str | Path) -> list[Path]:
        """Write `report.html` and every figure as a PNG into `folder` (made if missing) and return the paths."""
        from .comparison_page import comparison_page
        from .document import write_page

        paths = self.save_pictures(folder)
        page = Path(folder) / "report.html"
        write_page(page, comparison_page(self))
        return [page, *paths]

    def save_pictures(self, folder: str | Path) -> list[Path]:
        """Write every figure as a PNG into `folder` (made if missing) and return the paths."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        paths = []
        for name in self._drawings:
            paths.append(folder / f"{name}.png")
            paths[-1].write_bytes(self._picture(name))
        return paths

    def _repr_html_(self) -> str:
        from .comparison_page import comparison_page
        from .document import rendered

        return rendered(comparison_page(self), whole=False)
