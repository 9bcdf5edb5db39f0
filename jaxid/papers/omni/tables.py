"""The omni paper's Tables 2-6, computed again from what it prints, next to what it prints; and Tables 5, 6 from logs.

Tables 2, 4, 5 and 6 start from printed, rounded numbers, so the paper's own differ from them in the last digits. Table
3 prints B/M and C/M with two digits, cut off and not rounded, beside B and C.
"""

from dataclasses import dataclass

from ...estimate.result import Estimate
from ...robots.omni import Omni
from ..mean import mean_of
from ..paper_table import PaperTable
from .experiments import CoastDown, SteadyState
from .hanging import Hanging
from .methods import steady_state_friction
from .printed import (
    AXES,
    COULOMB,
    DISC_RADIUS,
    HANGING_MASSES,
    MASS,
    TABLE_1,
    TABLE_2,
    TABLE_3,
    TABLE_4,
    TABLE_5,
    TABLE_6,
    VISCOUS,
)

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
    """Table 3: the printed coefficients and the printed frictions, each in the other's terms."""
    rows = []
    for axis, (slope, offset, viscous, coulomb) in TABLE_3.items():
        rows.append((VISCOUS[axis], slope, MASS * slope, viscous, viscous / MASS))
        rows.append((COULOMB[axis], offset, MASS * offset, coulomb, coulomb / MASS))
    header = ("symbol", "coefficient", "times M", "paper", "paper / M")
    note = "The coefficients are the frictions over M = 35 kg, cut off (not rounded) after two digits."
    return PaperTable("Table 3: printed coefficients against printed frictions", header, tuple(rows), (note,))


def table_4() -> PaperTable:
    """Table 4: printed torque over printed acceleration, and what is left without the falling mass's own inertia."""
    mass_inertia = [mass * DISC_RADIUS**2 for mass in HANGING_MASSES]
    found = [
        (torque / acceleration, J, own) for (torque, acceleration, J), own in zip(TABLE_4, mass_inertia, strict=True)
    ]
    rows = [(f"J, exp. {n}", mine, J, mine - J, own, mine - own) for n, (mine, J, own) in enumerate(found, start=1)]
    means = [sum(column) / len(found) for column in zip(*found, strict=True)]
    paper = TABLE_6["Method 3 (mean)"]
    rows.append(("J, mean", means[0], paper, means[0] - paper, means[2], means[0] - means[2]))
    header = ("symbol", "recomputed", "paper", "difference", "falling mass's", "without it")
    return PaperTable("Table 4: torque over acceleration", header, tuple(rows))


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
