"""The omni paper's tables again, from what it prints."""

import numpy as np
import pytest

from jaxid.papers.omni import tables as omni_tables
from jaxid.papers.omni.methods import (
    steady_state_friction,
)
from jaxid.papers.omni.printed import TABLE_1, TABLE_2, TABLE_4, TABLE_5, TABLE_6
from jaxid.papers.paper_table import PaperTable
from jaxid.robots import Omni

M = 35.0


@pytest.mark.parametrize("axis, exact", [("V", (3.478, 28.54)), ("Vn", (2.912, 28.47)), ("W", (0.7355, 5.122))])
def test_table_2_from_table_1(axis, exact):
    found = steady_state_friction(*TABLE_1[axis], axis)
    np.testing.assert_allclose([found.viscous.value, found.coulomb.value], exact, rtol=5e-4)
    np.testing.assert_allclose([found.viscous.value, found.coulomb.value], np.polyfit(*TABLE_1[axis], 1), rtol=1e-10)
    # The paper prints the same lines, up to less than 1 % of the slope: far inside the regression's own uncertainty.
    for e, printed in zip((found.viscous, found.coulomb), TABLE_2[axis], strict=True):
        assert 0 < abs(e.value - printed) < 0.14 * e.std_error
        assert e.ci95[0] < printed < e.ci95[1]


def test_standard_errors_are_those_of_the_regression_line():
    from scipy.stats import linregress

    found, line = steady_state_friction(*TABLE_1["V"], "V"), linregress(*TABLE_1["V"])
    assert found.viscous.std_error == pytest.approx(line.stderr, rel=1e-10)
    assert found.coulomb.std_error == pytest.approx(line.intercept_stderr, rel=1e-10)
    half = found.viscous.ci95[1] - found.viscous.value
    assert half / found.viscous.std_error == pytest.approx(4.3027, abs=1e-4)  # Student's t with two degrees of freedom


def cells(table: PaperTable) -> dict[str, tuple[float, float]]:
    return {row[0]: (row[1], row[table.columns.index("paper")]) for row in table.rows}


def test_table_2_differs_from_its_table_1_by_more_than_rounding():
    """Table 1 has three digits after the point: they move a slope by at most 0.002, an intercept by 0.0018."""
    for axis, off in (("V", True), ("Vn", True), ("W", False)):
        speeds, forces = np.array(TABLE_1[axis])
        to_line = np.linalg.pinv(np.stack([speeds, np.ones(4)], axis=1))
        reach = 0.0005 * np.abs(to_line).sum(axis=1)
        np.testing.assert_allclose(reach, [0.002, 0.0018], atol=1e-5)
        # Cut off or rounded, a printed number lies within one unit of its last digit.
        beyond = np.abs(to_line @ forces - TABLE_2[axis]) - reach
        assert (beyond[0] > 0.008) == off and (beyond[1] > 0.005) == off and (off or np.all(beyond < 0.01))


def test_table_3s_coefficients_are_its_frictions_over_m_cut_off_after_two_digits():
    table = omni_tables.table_3()
    assert table.column("paper") == (4.01, 30.35, 3.77, 30.76)
    np.testing.assert_allclose(np.array(table.column("times M"), float), [3.85, 30.1, 3.50, 30.45], rtol=1e-12)
    exact = np.array(table.column("paper"), float) / M
    np.testing.assert_array_equal(np.floor(100 * exact) / 100, table.column("coefficient"))
    np.testing.assert_allclose(np.array(table.column("paper / M"), float), [0.1146, 0.8671, 0.1077, 0.8789], atol=5e-5)
    assert np.sum(np.round(exact, 2) != table.column("coefficient")) == 3  # rounded they are not


def test_table_4_is_its_torque_over_its_acceleration_within_their_rounding():
    for torque, acceleration, J in TABLE_4:
        low, high = torque / (acceleration + 5e-5), torque / (acceleration - 5e-5)
        assert low < J + 5e-5 and J - 5e-5 < high
    np.testing.assert_allclose(
        [row[0] for row in TABLE_4], np.array([0.510, 0.510, 0.510, 1.0]) * 9.8 * 0.25, rtol=1e-12
    )


def test_tables_4_5_and_6():
    table = cells(omni_tables.table_4())
    for n, exact in enumerate((1.3692, 1.3973, 1.3966, 1.3990), start=1):
        assert table[f"J, exp. {n}"][0] == pytest.approx(exact, abs=6e-5)
        assert table[f"J, exp. {n}"][1] == TABLE_4[n - 1][2]
    assert table["J, mean"][0] == pytest.approx(1.3905, abs=5e-5)
    for name, (mine, paper) in cells(omni_tables.table_5()).items():
        assert paper == TABLE_5[name] and mine == pytest.approx(paper, abs=0.0051)  # 3.335 is printed as 3.34
    assert cells(omni_tables.table_6())["J, mean"][0] == pytest.approx(TABLE_6["Mean"], abs=5e-4)


def test_the_omni_has_the_papers_means():
    p = Omni().parameters.numbers
    assert {name: p[name] for name in TABLE_5} == TABLE_5
    assert (p["J"], p["M"]) == (TABLE_6["Mean"], 35.0)
