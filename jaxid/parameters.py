"""Physical parameters: value, unit, free or fixed, bounds, prior and where the default comes from.

A `ParameterTable` is an ordered mapping from a parameter's symbol to its `Parameter`. The numbers alone, which is what
models compute with, are a plain dictionary (`table.numbers`).
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from ._table import html_table, text_table

if TYPE_CHECKING:
    import pandas as pd


class ParameterError(ValueError):
    """A parameter that cannot be used; the message names it and the remedy."""


@dataclass(frozen=True)
class Parameter:
    """One physical parameter.

    `value` is in `unit` (SI). A `free` parameter is estimated, a fixed one is taken as known. Estimates never leave
    `[lower, upper]`. `prior` is an optional Gaussian `(mean, standard deviation)` in the same unit. `typical` is the order
    of magnitude to expect of a parameter whose value is zero at the start. `source` says where the default comes from and
    `meaning` what the symbol stands for.
    """

    value: float
    unit: str = ""
    free: bool = False
    lower: float = -math.inf
    upper: float = math.inf
    prior: tuple[float, float] | None = None
    typical: float | None = field(default=None, compare=False)
    source: str = ""
    meaning: str = ""

    def inside(self, value: float) -> float:
        """The value, or the bound that it lies beyond."""
        return float(min(max(value, self.lower), self.upper))

    def check(self, name: str) -> None:
        """Raise `ParameterError` if value, bounds or prior contradict one another."""
        if not math.isfinite(self.value):
            raise ParameterError(
                f"parameter {name} = {self.value} is not a finite number; give it a value in {self.unit}"
            )
        if not self.lower < self.upper:
            raise ParameterError(
                f"parameter {name} has lower bound {self.lower} not below its upper bound {self.upper}; widen the bounds"
            )
        if not self.lower <= self.value <= self.upper:
            raise ParameterError(
                f"parameter {name} = {self.value} {self.unit} lies outside its bounds [{self.lower}, {self.upper}]; "
                "change the value or the bounds"
            )
        # The deviation is used by its inverse square, which must be a number, too.
        if self.prior is not None and not (math.isfinite(self.prior[0]) and 1e-100 < self.prior[1] < 1e100):
            raise ParameterError(
                f"parameter {name} has prior {self.prior}; give a finite mean and a positive deviation"
            )


def parameter(
    value: float,
    unit: str,
    meaning: str,
    source: str,
    *,
    positive: bool = True,
    free: bool = False,
    typical: float | None = None,
) -> Parameter:
    """A robot's parameter; positive ones are bounded below by zero."""
    lower = 0.0 if positive else -math.inf
    return Parameter(value, unit, free=free, lower=lower, typical=typical, source=source, meaning=meaning)


class ParameterTable(Mapping[str, Parameter]):
    """An immutable, ordered mapping symbol -> `Parameter`. Every change returns a new table.

    >>> import jaxid
    >>> table = jaxid.Axis().parameters.change("M", value=2.5, free=False)
    >>> table["M"].value, table["M"].unit, table.free_names
    (2.5, 'kg', ('Fv', 'Fc', 'offset'))
    """

    def __init__(self, parameters: Mapping[str, Parameter]):
        for name, parameter in parameters.items():
            parameter.check(name)
        self._parameters = dict(parameters)

    def __getitem__(self, name: str) -> Parameter:
        try:
            return self._parameters[name]
        except KeyError:
            known = ", ".join(self._parameters)
            raise ParameterError(f"there is no parameter {name!r}; the parameters are {known}") from None

    def __contains__(self, name: object) -> bool:
        return name in self._parameters

    def __iter__(self) -> Iterator[str]:
        return iter(self._parameters)

    def __len__(self) -> int:
        return len(self._parameters)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ParameterTable) and self._parameters == other._parameters

    def __hash__(self) -> int:
        return hash(frozenset(self._parameters.items()))

    @property
    def numbers(self) -> dict[str, float]:
        """The values alone, by symbol."""
        return {name: parameter.value for name, parameter in self.items()}

    @property
    def free_names(self) -> tuple[str, ...]:
        """Symbols of the parameters that are estimated, in table order."""
        return tuple(name for name, parameter in self.items() if parameter.free)

    def change(self, name: str, **fields: Any) -> "ParameterTable":
        """The table with some fields of one parameter changed (`value=`, `free=`, `lower=`, `upper=`, `prior=` …)."""
        return ParameterTable({**self._parameters, name: replace(self[name], **fields)})

    def with_values(self, values: Mapping[str, float]) -> "ParameterTable":
        """The table with new values, all else unchanged. Raises `ParameterError` for unknown names."""
        table = dict(self._parameters)
        for name, value in values.items():
            parameter = self[name]
            try:
                table[name] = replace(parameter, value=float(value))
            except (TypeError, ValueError):
                raise ParameterError(
                    f"parameter {name} = {value!r:.60} is no number; give one in {parameter.unit}"
                ) from None
        return ParameterTable(table)

    def with_free(self, *names: str) -> "ParameterTable":
        """The table in which exactly `names` are free."""
        for name in names:
            self[name]
        return ParameterTable({name: replace(p, free=name in names) for name, p in self.items()})

    def merge(self, other: Mapping[str, Parameter]) -> "ParameterTable":
        """The table with further parameters appended."""
        return ParameterTable({**self._parameters, **other})

    def to_pandas(self) -> "pd.DataFrame":
        """A row for every parameter by symbol: `value`, `unit`, `free`, `lower`, `upper`, `prior`, `source`, `meaning`."""
        import pandas as pd  # robots and model files need no tables

        fields = ["value", "unit", "free", "lower", "upper", "prior", "source", "meaning"]
        rows = {name: [getattr(p, field) for field in fields] for name, p in self.items()}
        return pd.DataFrame.from_dict(rows, orient="index", columns=fields).rename_axis("parameter")

    def _rows(self) -> list[tuple[str, ...]]:
        rows = [(n, f"{p.value:.6g}", p.unit, "free" if p.free else "fixed", p.meaning) for n, p in self.items()]
        return [("", "value", "unit", "", "meaning"), *rows]

    def __repr__(self) -> str:
        return text_table(self._rows(), right=(1,))

    def _repr_html_(self) -> str:
        return html_table(self._rows(), right=(1,))
