"""The omni paper's Tables 2-6, computed again from what it prints, next to what it prints; and Tables 5, 6 from logs.

Tables 2, 4, 5 and 6 start from printed, rounded numbers, so the paper's own differ from them in the last digits. Table
3 prints B/M and C/M with two digits, which times M does not give the printed B and C.
"""

from dataclasses import dataclass

from ...estimate.result import Estimate
from ...robots.omni import Omni
from ..mean import mean_of
from ..paper_table import PaperTable
from .experiments import CoastDown, SteadyState
from .hanging import Hanging
from .methods import steady_state_friction
from .printed import AXES, COULOMB, MASS, TABLE_1, TABLE_2, TABLE_3, TABLE_4, TABLE_5, TABLE_6, VISCOUS

_COLUMNS = ("symbol", "recomputed", "std error", "paper", "difference")


def table_2() -> PaperTable:
    """Table 2: the least-squares lines through the printed Table 1."""
    rows = []
    for axis in AXES:
        for (name, e), paper in zip(
            steady_state_friction(*TABLE_1[axis], axis).estimates.items(), TABLE_2[axis], strict=True
        ):
            rows.append((name, e.value, e.std_error, paper, e.value - paper))
    return PaperTable("Table 2 from Table 1", _COLUMNS, tuple(rows))


def table_3() -> PaperTable:
    """Table 3: the printed coefficients times M against the printed frictions."""
    rows = []
    for axis, (slope, offset, viscous, coulomb) in TABLE_3.items():
        rows.append((VISCOUS[axis], MASS * slope, None, viscous, MASS * slope - viscous))
        rows.append((COULOMB[axis], MASS * offset, None, coulomb, MASS * offset - coulomb))
    note = "Printed with two digits: B/M = 0.11 stands for 3.68 to 4.03 N s/m, 0.10 for 3.33 to 3.68 N s/m."
    return PaperTable("Table 3: printed coefficients times M", _COLUMNS, tuple(rows), (note,))


def table_4() -> PaperTable:
    """Table 4: printed torque over printed acceleration."""
    rows = [(f"J, exp. {n}", a / b, None, J, a / b - J) for n, (a, b, J) in enumerate(TABLE_4, start=1)]
    mean = sum(a / b for a, b, _ in TABLE_4) / len(TABLE_4)
    paper = TABLE_6["Method 3 (mean)"]
    return PaperTable(
        "Table 4: torque over acceleration", _COLUMNS, (*rows, ("J, mean", mean, None, paper, mean - paper))
    )


def table_5() -> PaperTable:
    """Table 5: means of the printed Tables 2 and 3."""
    rows = []
    for axis in AXES:
        for k, name in enumerate((VISCOUS[axis], COULOMB[axis])):
            values = [TABLE_2[axis][k], *([TABLE_3[axis][2 + k]] if axis in TABLE_3 else [])]
            mean = sum(values) / len(values)
            rows.append((name, mean, None, TABLE_5[name], mean - TABLE_5[name]))
    return PaperTable("Table 5: means of methods 1 and 2", _COLUMNS, tuple(rows))


def table_6() -> PaperTable:
    """Table 6: mean of methods 1+2 and 3."""
    third = sum(J for _, _, J in TABLE_4) / len(TABLE_4)
    mean = 0.5 * (TABLE_6["Methods 1+2"] + third)
    rows = (
        ("J, method 3", third, None, TABLE_6["Method 3 (mean)"], third - TABLE_6["Method 3 (mean)"]),
        ("J, mean", mean, None, TABLE_6["Mean"], mean - TABLE_6["Mean"]),
    )
    return PaperTable("Table 6: means of the moments of inertia", _COLUMNS, rows)


@dataclass(frozen=True, repr=False)
class Summary:
    """The paper's three methods on logs and the means it takes for its model (Tables 5 and 6)."""

    first: SteadyState
    second: CoastDown
    third: Hanging | None = None

    @property
    def parameters(self) -> dict[str, Estimate]:
        """Means over the methods by symbol: frictions (Table 5) and J (Table 6)."""
        found: dict[str, list[Estimate]] = {}
        for result in (self.first, self.second):
            for friction in result.friction.values():
                for name, estimate in friction.estimates.items():
                    found.setdefault(name, []).append(estimate)
        inertias = [self.second.inertia.J] if self.second.inertia else []
        inertias += [self.third.mean] if self.third else []
        means = {name: mean_of(found[name]) for name in TABLE_5 if name in found}
        return means | ({"J": mean_of(inertias)} if inertias else {})

    def robot(self, robot: Omni | None = None) -> Omni:
        """The robot with these means as its parameters."""
        robot = Omni() if robot is None else robot
        return robot.with_values(**{name: estimate.value for name, estimate in self.parameters.items()})

    @property
    def table(self) -> PaperTable:
        """The means next to the paper's Tables 5 and 6."""
        printed = {**TABLE_5, "J": TABLE_6["Mean"]}
        rows = tuple((n, e.value, e.std_error, e.unit, printed[n]) for n, e in self.parameters.items())
        return PaperTable("Means of the methods (Tables 5, 6)", ("symbol", "value", "std error", "unit", "paper"), rows)

    def __repr__(self) -> str:
        return repr(self.table)

    def _repr_html_(self) -> str:
        return self.table._repr_html_()
