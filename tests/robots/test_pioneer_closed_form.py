"""The Pioneer's scalar closed forms against its matrices, and both against every number the paper prints.

The matrices themselves are tested against independent mechanics in `tests/papers/pioneer/test_equations.py`.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid._float64 import float64
from jaxid.papers.pioneer import equations as eq
from jaxid.robots import pioneer_closed_form as closed
from tests.pioneer_numbers import FREE, ON_THE_SPOT, PAPER


@pytest.fixture(autouse=True)
def double_precision():
    with float64():
        yield


def random_cases(n=200, seed=1906):
    """States, speeds, voltages and parameters, all different: each parameter up to a factor of about 3 from print."""
    rng = np.random.default_rng(seed)
    p = {name: value * np.exp(rng.uniform(-1.1, 1.1, n)) for name, value in PAPER.items()}
    p |= {"xm": rng.uniform(-0.1, 0.1, n), "ym": rng.uniform(-0.2, 0.2, n)}
    return rng.uniform(-3, 3, (n, 7)), rng.normal(size=(n, 2)) * [1.0, 2.0], rng.uniform(-12, 12, (n, 2)), p


def over(function):
    return jax.jit(jax.vmap(function))


def printed_a22(p, caster_arm_squared):
    """The denominator of a22 [kg m^2] with what stands before Ir1 / R1^2 left open."""
    platform = p["M"] * (p["xm"] ** 2 + p["ym"] ** 2) + p["I0"] + 2 * p["Ip"] + 2 * p["m"] * p["L"] ** 2
    wheels = caster_arm_squared * p["Ir1"] / p["R1"] ** 2 + 2 * p["L"] ** 2 * p["Ir"] / p["R"] ** 2
    return platform + p["m1"] * p["l1"] ** 2 + wheels


def test_closed_forms_equal_the_matrices():
    q, eta, _, p = random_cases()
    cos_b, sin_b = np.cos(q[:, 3]), np.sin(q[:, 3])
    reduced = over(eq.J)(q, p)
    expected = (reduced[:, 0, 0], reduced[:, 0, 1], reduced[:, 1, 1])
    for ours, matrix in zip(closed.reduced_inertia(cos_b, sin_b, p), expected, strict=True):
        np.testing.assert_allclose(ours, matrix, rtol=1e-10, atol=1e-12)
    bias = np.stack(closed.bias(cos_b, sin_b, eta[:, 0], eta[:, 1], p), 1)
    np.testing.assert_allclose(bias, over(eq.g)(q, eta, p), rtol=1e-10, atol=1e-10)
    rates = over(lambda q, e, p: eq.S(q, p) @ e)(q, eta, p)
    np.testing.assert_allclose(
        closed.caster_rate(cos_b, sin_b, eta[:, 0], eta[:, 1], p), rates[:, 3], rtol=1e-10, atol=1e-12
    )


def test_closed_forms_broadcast_and_agree_in_numpy_and_jax():
    beta, eta1 = np.linspace(-3, 3, 5)[:, None], np.linspace(-1, 1, 4)
    arguments = (np.cos(beta), np.sin(beta), eta1, 0.7, PAPER)
    assert closed.bias(*arguments)[0].shape == (5, 4)
    np.testing.assert_allclose(jax.jit(closed.bias)(*arguments), closed.bias(*arguments), rtol=1e-12, atol=1e-14)


def test_equation_33_is_the_full_model():
    q, eta, voltage, p = random_cases()
    rates = closed.equation_33_acceleration(q[:, 3], eta[:, 0], eta[:, 1], voltage[:, 0], voltage[:, 1], p)
    ours = np.stack(rates, 1)
    np.testing.assert_allclose(ours, over(eq.acceleration)(q, eta, voltage, p), rtol=1e-9, atol=1e-9)
    assert [name for name in closed.equation_33(0.3, PAPER) if name.startswith("a1")][:9] == [
        f"a1{column}" for column in range(1, 10)
    ]


def test_equations_34_and_35_are_special_cases_of_33():
    a, straight = closed.equation_33(0.0, PAPER), closed.straight_coefficients(PAPER)
    np.testing.assert_allclose((a["a11"], a["a15"], a["a18"]), straight, rtol=1e-13)
    np.testing.assert_allclose([a[n] for n in ("a12", "a13", "a19", "a1_caster", "a23", "a25", "a28")], 0, atol=1e-15)
    a, turning = closed.equation_33(-np.pi / 2, PAPER), closed.turning_coefficients(PAPER)
    np.testing.assert_allclose((a["a22"], a["a26"], a["a29"] + a["a2_caster"]), turning, rtol=1e-13)
    np.testing.assert_allclose([a[n] for n in ("a21", "a24", "a28")], 0, atol=1e-13)

    p = PAPER  # the formulas as printed, but for a22's l1^2
    a11 = 1 / (p["M"] + 2 * p["m"] + p["m1"] + p["Ir1"] / p["R1"] ** 2 + 2 * p["Ir"] / p["R"] ** 2)
    a15 = 2 * (p["tr"] ** 2 * p["mu"] * p["KT"] * p["KE"] + p["Ra"] * p["Cv"]) / (p["R"] ** 2 * p["Ra"]) * a11
    a18 = 2 * (p["Cs"] + p["tr"] * p["mu"] * p["tau_fr"]) / p["R"] * a11
    np.testing.assert_allclose(straight, (a11, a15, a18), rtol=1e-13)
    motor = 2 * p["L"] ** 2 * p["tr"] ** 2 * p["mu"] * p["KT"] * p["KE"]
    viscous = motor + p["Cv1"] * p["R"] ** 2 * p["Ra"] + 2 * p["L"] ** 2 * p["Cv"] * p["Ra"]
    coulomb = 2 * p["L"] * p["tr"] * p["mu"] * p["tau_fr"] + p["Cs1"] * p["R"] + 2 * p["L"] * p["Cs"]
    a22 = 1 / printed_a22(p, p["l1"] ** 2)
    a26, a29 = viscous / (p["R"] ** 2 * p["Ra"]) * a22, coulomb / p["R"] * a22
    np.testing.assert_allclose(turning, (a22, a26, a29), rtol=1e-13)


def test_friction_is_recovered_from_the_coefficients():
    _, _, _, p = random_cases()
    cv, cs = closed.wheel_friction(closed.straight_coefficients(p), p)
    cv1, cs1 = closed.caster_friction(closed.turning_coefficients(p), p)
    np.testing.assert_allclose(np.stack([cv, cs]), np.stack([p["Cv"], p["Cs"]]), rtol=1e-10)
    np.testing.assert_allclose(np.stack([cv1, cs1]), np.stack([p["Cv1"], p["Cs1"]]), rtol=1e-8)


def test_numbers_of_the_paper():
    straight, turning = closed.straight_coefficients(PAPER), closed.turning_coefficients(PAPER)
    assert 1 / straight.a11 == pytest.approx(17.078, abs=5e-4)
    assert eq.J(np.zeros(7), PAPER)[0, 0] == pytest.approx(17.078, abs=5e-4)
    assert 1 / straight.a11 == pytest.approx(17.07, abs=0.01)  # from data, table 3
    assert 1 / turning.a22 == pytest.approx(0.42418, abs=5e-6)
    assert eq.J(ON_THE_SPOT, PAPER)[1, 1] == pytest.approx(0.42418, abs=5e-6)
    assert 1 / turning.a22 == pytest.approx(0.424, abs=5e-4)  # from data, table 4
    assert straight.a15 == pytest.approx(4.396, abs=5e-4)
    assert straight.a18 == pytest.approx(0.5663, abs=5e-5)
    assert 1 / straight.a15 == pytest.approx(0.227, abs=5e-4)
    assert 1 / turning.a26 == pytest.approx(0.198, abs=5e-4)


def test_speed_and_threshold_on_a_straight_line():
    @jax.jit
    def rate(v, volt):
        return eq.acceleration(jnp.zeros(7), jnp.array([v, 0.0]), jnp.array([volt, volt]), PAPER)[0]

    # The threshold is the voltage at which a crawling robot neither gains nor loses speed.
    pull = [float(rate(1e-9, volt)) for volt in (0.0, 12.0)]
    assert -12.0 * pull[0] / (pull[1] - pull[0]) == pytest.approx(0.86, abs=0.005)
    run = solve_ivp(lambda _, v: [float(rate(v[0], 12.0))], (0, 4), [1e-6], rtol=1e-8)
    assert run.y[0, -1] == pytest.approx(1.68, abs=0.005)


def test_means_of_tables_3_and_4():
    table_3 = np.array([[17.83, 0.0441, 0.3349], [16.49, 0.0445, 0.3287], [16.89, 0.0446, 0.2921]])
    table_4 = np.array([[0.4301, 0.000429, 0.004535], [0.4127, 0.000389, 0.004532], [0.4292, 0.000469, 0.004541]])
    last_digit_3, last_digit_4 = np.array([0.01, 1e-4, 1e-4]), np.array([1e-3, 1e-6, 1e-6])
    assert np.all(np.abs(table_3.mean(0) - (17.07, 0.0444, 0.3186)) <= last_digit_3 / 2)
    assert np.all(np.abs(table_4.mean(0) - (0.424, 0.000429, 0.004536)) <= last_digit_4 / 2 + 1e-12)
    assert abs(table_3[:, 2].mean() - 0.3184) > 1.5e-4  # table 5's Cs is not that mean


def test_printed_sum_of_a11_has_an_arithmetic_slip():
    total = 15.5 + 2 * 0.35 + 0.35 + 2.144e-4 / 0.035**2 + 2 * 0.0012 / 0.0825**2
    assert total == pytest.approx(17.0776, abs=5e-5) and abs(total - 17.0750) > 2e-3


def test_printed_sign_of_inertia_13_shows_only_in_the_coupled_terms():
    flipped = PAPER | {"ym": -PAPER["ym"]}  # M33 has ym^2, so only M13 feels this
    a, b = closed.equation_33(0.4, PAPER), closed.equation_33(0.4, flipped)
    changed = {name for name in a if not np.isclose(a[name], b[name], rtol=1e-12, atol=1e-12)}
    assert changed == {"a14", "a24", "a17", "a27"}
    assert closed.straight_coefficients(PAPER) == closed.straight_coefficients(flipped)


def test_printed_a22_has_a_wheel_inertia_for_a_lever_arm():
    physics = float(eq.J(ON_THE_SPOT, PAPER)[1, 1])
    assert printed_a22(PAPER, PAPER["l1"] ** 2) == pytest.approx(physics, rel=1e-12)
    lost = PAPER["l1"] ** 2 * PAPER["Ir1"] / PAPER["R1"] ** 2
    assert physics - printed_a22(PAPER, PAPER["Ir"] ** 2) == pytest.approx(lost, rel=1e-3)
    assert printed_a22(PAPER, PAPER["Ir"] ** 2) == pytest.approx(0.4185, abs=5e-5)  # the paper measures 0.424


def test_printed_wheel_distance_is_a_hundred_times_too_long():
    assert 1 / closed.turning_coefficients(PAPER).a22 == pytest.approx(0.424, abs=5e-4)
    assert 1 / closed.turning_coefficients(PAPER | {"L": 16.89}).a22 > 290  # kg m^2, the paper measures 0.424


def test_caster_settles_beyond_minus_90_degrees():
    run = solve_ivp(
        lambda _, b: closed.caster_rate(np.cos(b), np.sin(b), 0.0, 1.0, PAPER), (0, 20), [-0.5], rtol=1e-10, atol=1e-12
    )
    settled = run.y[0, -1]
    assert np.degrees(settled) == pytest.approx(-99.6, abs=0.05)
    assert PAPER["d"] + PAPER["l1"] * np.cos(settled) == pytest.approx(0.0, abs=1e-9)
    pivot_free = PAPER | dict(Cs1=0.0, Cv1=0.0)
    at_rest, in_print = np.zeros(7), np.zeros(7)
    at_rest[3], in_print[3] = -np.arccos(-PAPER["d"] / PAPER["l1"]), -np.pi / 2
    eta = np.array([0.0, 1.0])
    assert closed.caster_rate(0.0, -1.0, 0.0, 1.0, PAPER) == pytest.approx(-1.0)
    # Whatever holds the pivot there, it has no lever arm on the turn.
    np.testing.assert_allclose(eq.f_r(at_rest, eta, PAPER)[1], eq.f_r(at_rest, eta, pivot_free)[1], rtol=1e-12)
    share = eq.f_r(in_print, eta, PAPER)[1] - eq.f_r(in_print, eta, pivot_free)[1]
    assert share == pytest.approx(PAPER["Cs1"] + PAPER["Cv1"], rel=1e-12)


@pytest.mark.parametrize("m13", ["corrected", "as printed"])
def test_opposite_voltages_do_not_turn_the_robot_on_the_spot(m13):
    # With the caster at rest in the body, steady motion is algebra: the centre of mass, ym off the axle, pulls the
    # robot along by M ym eta2^2, and only the wheels' viscous friction holds it.
    # The printed sign of M13 is a centre of mass ahead of the axle: M33 and J have ym^2 alone.
    p, volts = PAPER | {"Cs1": 0.0, "ym": PAPER["ym"] if m13 == "corrected" else -PAPER["ym"]}, 6.0
    wheel = p["Cv"] + p["tr"] ** 2 * p["mu"] * p["KT"] * p["KE"] / p["Ra"]
    drag = 2 * wheel / p["R"] ** 2
    coulomb = 2 * (p["Cs"] + p["tr"] * p["mu"] * p["tau_fr"]) / p["R"]
    pull = p["M"] * p["ym"]
    drive = 2 * p["tr"] * p["mu"] * p["KT"] * volts / (p["R"] * p["Ra"])
    roots = np.roots([pull**2 / drag, 0.0, drag * p["L"] ** 2, (coulomb - drive) * p["L"]])
    eta2 = float(roots[np.abs(roots.imag) < 1e-9].real[0])
    eta1 = pull * eta2**2 / drag
    # d + l1 cos(beta) + (eta1/eta2) sin(beta) = 0, the branch that a left turn makes stable
    ratio = eta1 / eta2
    beta = np.arctan2(ratio, p["l1"]) - np.arccos(-p["d"] / np.hypot(ratio, p["l1"]))
    q = np.array([0.0, 0.0, 0.0, beta, 0.0, 0.0, 0.0])
    rates = eq.acceleration(q, np.array([eta1, eta2]), np.array([volts, -volts]), p)
    np.testing.assert_allclose(rates, 0.0, atol=1e-11)
    assert closed.caster_rate(np.cos(beta), np.sin(beta), eta1, eta2, p) == pytest.approx(0.0, abs=1e-11)
    assert (abs(eta1), eta2) == (pytest.approx(0.24, abs=0.005), pytest.approx(4.10, abs=0.02))
    assert eta1 < 0 if m13 == "corrected" else eta1 > 0
    if m13 == "corrected":
        assert np.degrees(beta) == pytest.approx(-117.3, abs=0.3)


def test_printed_signs_of_equation_33_hold_on_the_experiments_only():
    def dry_force(eta1, eta2):  # on the wheels alone, in units of 2 Cs / R
        p = FREE | {"Cs": 1.0}
        return float(eq.f_r(np.zeros(7), np.array([eta1, eta2]), p)[0]) * p["R"] / 2

    assert [dry_force(v, 0.0) for v in (0.4, -0.4)] == pytest.approx([1.0, -1.0])
    assert dry_force(0.1, 2.0) == pytest.approx(0.0)  # sign(eta1) = 1, but the wheels turn against each other
