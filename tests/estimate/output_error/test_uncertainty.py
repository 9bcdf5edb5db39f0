"""Covariances, what is not determined, and the delta method, against linear algebra written out."""

import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, Log, LogSet, Parameter, Pioneer, output_error
from jaxid.estimate.result import Estimate
from jaxid.estimate.uncertainty import combinations, estimates, spread

ALL = np.ones(4, dtype=bool)


@pytest.fixture
def jacobian():
    return np.random.default_rng(1).normal(size=(40, 4)) * [1.0, 1e3, 1e-4, 10.0]


def test_covariance_is_the_inverse_of_the_normal_matrix(jacobian):
    found = spread(jacobian, ALL, np.full(4, 1e9))
    scale = np.linalg.norm(jacobian, axis=0)
    inverse = np.linalg.inv((jacobian / scale).T @ (jacobian / scale)) / np.outer(scale, scale)
    np.testing.assert_allclose(found.covariance, inverse, rtol=1e-9)
    assert found.determined.all()


def test_fewer_rows_than_parameters_leave_directions_open(jacobian):
    found = spread(jacobian[:2], ALL, np.full(4, 1e9))
    assert np.isfinite(found.covariance).all()
    assert not found.determined.all()


def test_derivatives_that_overflowed_determine_nothing(jacobian):
    jacobian[3, 2] = np.inf
    found = spread(jacobian, ALL, np.full(4, 1e9))
    assert np.isfinite(found.covariance).all()
    assert not found.determined.any() and found.unseen.all()


def test_held_parameters_have_no_variance_and_do_not_widen_the_others(jacobian):
    free = np.array([True, False, True, True])
    found = spread(jacobian, free, np.full(4, 1e9))
    kept = np.flatnonzero(free)
    expected = np.linalg.inv(jacobian[:, kept].T @ jacobian[:, kept])
    np.testing.assert_allclose(found.covariance[np.ix_(kept, kept)], expected, rtol=1e-6)
    assert np.all(found.covariance[1] == 0) and np.all(found.covariance[:, 1] == 0)
    none = spread(jacobian, np.zeros(4, dtype=bool), np.ones(4))
    assert np.all(none.covariance == 0)


def test_a_pair_that_acts_as_one_is_not_determined_but_its_product_is(jacobian):
    """Columns 0 and 3 proportional: only their weighted sum shows in the data."""
    jacobian[:, 3] = 2.0 * jacobian[:, 0]
    found = spread(jacobian, ALL, np.full(4, 1e9))
    np.testing.assert_array_equal(found.determined, [False, True, True, False])
    visible = np.array([1.0, 0.0, 0.0, 2.0])  # theta0 + 2 theta3
    reduced = jacobian[:, [0, 1, 2]]
    expected = np.linalg.inv(reduced.T @ reduced)[0, 0]
    assert visible @ found.covariance @ visible == pytest.approx(expected, rel=1e-6)


def test_a_column_of_zeros_and_a_hopeless_error_are_not_determined(jacobian):
    jacobian[:, 1] = 0.0
    found = spread(jacobian, ALL, np.full(4, 1e9))
    np.testing.assert_array_equal(found.determined, [True, False, True, True])
    wide = np.sqrt(found.covariance[0, 0])
    magnitude = np.array([0.9 * wide, 1e9, 1e9, 1e9])  # the standard error exceeds the value itself
    assert not spread(jacobian, ALL, magnitude).determined[0]
    assert spread(jacobian, ALL, magnitude * [1.3, 1, 1, 1]).determined[0]


@pytest.mark.usefixtures("double_precision")
def test_combinations_by_the_delta_method():
    robot = Pioneer()
    numbers = robot.parameters.numbers
    names = ("I0", "Ir1", "Ir", "Ip1")
    factor = np.random.default_rng(2).normal(size=(4, 4)) * 1e-4
    covariance = factor @ factor.T
    found = combinations(robot, numbers, names, covariance)
    # 1/a11 = ... + Ir1 / R1^2 + 2 Ir / R^2 and 1/a22 = I0 + ... + (l1 / R1)^2 Ir1 + 2 (L / R)^2 Ir
    straight = np.array([0.0, 1 / 0.035**2, 2 / 0.0825**2, 0.0])
    turning = np.array([1.0, (0.18 / 0.035) ** 2, 2 * (0.1689 / 0.0825) ** 2, 0.0])
    for label, gradient in (("1/a11", straight), ("1/a22", turning)):
        assert found[label].std_error == pytest.approx(np.sqrt(gradient @ covariance @ gradient), rel=1e-9)
    mass = 15.5 + 3 * 0.35 + 2.144e-4 / 0.035**2 + 2 * 0.0012 / 0.0825**2
    assert found["1/a11"].value == pytest.approx(mass, rel=1e-12)


def test_every_parameter_of_the_table_gets_a_status():
    robot = Axis().change("Fc", free=True).change("offset", free=True)
    names = robot.parameters.free_names
    covariance = np.diag([1.0, 4.0, 9.0, 16.0])
    jacobian_spread = spread(np.diag([1.0, 0.5, 1 / 3, 0.25]), np.ones(4, bool), np.array([9.0, 9.0, 9.0, 1.0]))
    np.testing.assert_allclose(jacobian_spread.covariance, covariance)
    at_bound = np.array([False, False, True, False])
    found = estimates(robot, dict(zip(names, (5.0, 6.0, 0.0, 1.0), strict=True)), names, jacobian_spread, at_bound)
    assert [found[name].status for name in robot.parameters] == [
        "identified",
        "identified",
        "at_bound",
        "not_identifiable",
        "fixed",
        "fixed",
    ]
    assert found["Fv"].std_error == pytest.approx(2.0)
    assert found["Fv"].ci95 == pytest.approx((6.0 - 1.96 * 2, 6.0 + 1.96 * 2), abs=1e-3)
    assert found["Fc"].ci95[0] == 0.0  # no interval reaches beyond a bound
    assert np.isnan(found["gain"].std_error) and np.isnan(found["gain"].ci95).all()


def test_an_estimate_that_is_fixed_has_no_error():
    assert np.isnan(Estimate.of(1.0, 0.3, "kg", "fixed").std_error)


@pytest.mark.parametrize("weak", [1.0, 1e-3, 1e-4])
def test_a_parameter_that_hardly_shows_is_not_determined_where_it_scales_with_others_that_show_well(weak):
    """J theta = 0: all of the first four may be multiplied by one number, and nothing changes. The fifth is on its own."""
    rng = np.random.default_rng(4)
    theta = np.array([2.0, 1e-3, 40.0, 0.3, 5.0])
    relative = rng.normal(size=(60, 5)) * [1e3, 1e3, 1e3, 1e3 * weak, 10.0]
    relative[:, 0] = -relative[:, 1:4].sum(axis=1)
    found = spread(relative / theta, np.ones(5, dtype=bool), theta)
    assert found.unseen.tolist() == [True, True, True, True, False]
    assert found.determined.tolist() == [False, False, False, False, True]
    assert np.sqrt(found.covariance[4, 4]) == pytest.approx(theta[4] / np.linalg.norm(relative[:, 4]), rel=0.1)


def test_a_parameter_that_next_to_nothing_shows_is_not_identified():
    """It would have to be 1e18 to change the simulation: that its error is a little less says nothing of it."""
    channels = Channels(("u",), ("v",), units={"u": "N", "v": "m/s"})
    robot = Custom(
        dynamics=lambda x, u, p: {"v": u["u"] / p["M"] - p["d"] * x["v"] + 1e-18 * p["faint"] * x["v"] ** 2},
        state_names=("v",),
        own_channels=channels,
        table={name: Parameter(1.0, free=True) for name in ("M", "d", "faint")},
    )
    rng = np.random.default_rng(6)
    u, v = np.repeat(rng.uniform(-3.0, 3.0, 30), 20), np.zeros(600)
    for k in range(599):
        v[k + 1] = v[k] * np.exp(-0.03) + u[k] / 2.0 / 1.5 * (1.0 - np.exp(-0.03))
    log = Log.from_arrays("a", 0.02 * np.arange(600), u, v + 0.01 * rng.normal(size=600), channels)
    fit = output_error(robot, LogSet([log]))
    assert fit["faint"].status == "not_identifiable" and fit["faint"].std_error > 1e12
    assert fit["M"].value == pytest.approx(2.0, abs=4 * fit["M"].std_error) and fit["M"].status == "identified"


def turning(least):
    """A body that two forces drive and turn, whose inertia is at least so much."""
    return Custom(
        dynamics=lambda s, u, p: {
            "v": (u["right"] + u["left"] - p["c"] * s["v"]) / p["M"],
            "w": (0.2 * (u["right"] - u["left"]) - 0.4 * s["w"]) / p["J"],
        },
        state_names=("v", "w"),
        own_channels=Channels(inputs=("right", "left"), outputs=("v", "w"), units={"right": "N", "left": "N"}),
        table={
            "M": Parameter(8.0, "kg", free=True, lower=0.0),
            "c": Parameter(10.0, "N s/m", free=True, lower=0.0),
            "J": Parameter(0.3, "kg m^2", free=True, lower=least),
        },
    )


def turned(apart, seed):
    """Three of its logs in closed form, the forces so far `apart` [N]: 10 kg, 12 N s/m, 0.1 kg m^2."""
    random, logs = np.random.default_rng(seed), []
    for k in range(3):
        force, other = (np.repeat(random.uniform(-5, 5, 20), 25) for _ in range(2))
        forces = np.stack([force, force + apart * other / 5], axis=1)
        found = np.zeros((501, 2))
        for i, (right, left) in enumerate(forces):
            for j, (final, rate) in enumerate((((right + left) / 12, 1.2), ((right - left) / 2, 4.0))):
                found[i + 1, j] = final + (found[i, j] - final) * np.exp(-0.02 * rate)
        seen = found[:500] + 0.01 * random.normal(size=(500, 2))
        logs.append(Log.from_arrays(f"{k}", 0.02 * np.arange(500), forces, seen, turning(0.0)))
    return LogSet(logs)


def test_what_no_motion_shows_is_not_determined_on_its_bound_either():
    straight = output_error(turning(0.25), turned(1e-6, seed=0))
    assert straight["J"].value == 0.25 and straight["J"].status == "not_identifiable"
    assert any("do not determine J" in note for note in straight.notes)
    shown = output_error(turning(0.25), turned(1.0, seed=0))
    assert shown["J"].value == 0.25 and shown["J"].status == "at_bound"
    assert not any("do not determine" in note for note in shown.notes)
