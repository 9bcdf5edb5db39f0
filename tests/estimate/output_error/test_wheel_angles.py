"""Measured angles of wheels as outputs: speeds of an independent simulator, integrated by SciPy, with an encoder's steps or
white noise on them."""

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

import jaxid
from jaxid import Channels, Custom, Log, LogError, LogSet, Omni, Parameter, Pioneer
from jaxid.robots.drive_axis import DriveAxis
from jaxid.simulation.reckoning import measured_velocities

pytest.importorskip("numba", reason="the independent simulator needs numba")

SAMPLING, FINE = 0.02, 20
COUNTS = 500
"""Steps of the encoder in a turn."""


def wheel_rates(name, speeds, p):
    """Rates of the wheels' angles [T, wheels] of the body's speeds [T, velocities], by hand."""
    if name == "omni":
        V, Vn, spin = speeds[:, 0], speeds[:, 1], p["b"] * speeds[:, 2]
        return np.stack([Vn + spin, spin - V, spin - Vn, V + spin], axis=1) / p["r"]
    ahead, spin = speeds[:, 0], p["L"] * speeds[:, 1]
    return np.stack([ahead + spin, ahead - spin], axis=1) / p["R"]


def runs(name, kinds):
    """(time, inputs, angles) of runs of the reference robot: speeds every millisecond, Simpson's rule between."""
    from reference.excitation import experiment
    from reference.logs import simulate
    from reference.omni import OMNI
    from reference.pioneer import PIONEER

    p = (Pioneer() if name == "pioneer" else Omni()).parameters.numbers
    for seed, kind in enumerate(kinds):
        u = experiment(name, kind, 400, seed + 1)
        run = simulate(PIONEER if name == "pioneer" else OMNI, np.repeat(u, FINE, axis=0), SAMPLING / FINE)
        angles = cumulative_simpson(wheel_rates(name, run.speeds, p), x=run.t, axis=0, initial=0)
        n = min(len(u), len(run.t[::FINE]))
        yield kind, run.t[::FINE][:n], u[:n], angles[::FINE][:n]


def measured(robot, name, kinds, noise, rng):
    """Logs of the angles as a sensor that stood anywhere at the start shows them: with `noise` [rad], or counted."""
    logs = []
    for kind, time, inputs, angles in runs(name, kinds):
        seen = angles + rng.uniform(-50, 50, angles.shape[1])
        step = 2 * np.pi / COUNTS
        seen = seen + noise * rng.normal(size=seen.shape) if noise else step * np.floor(seen / step)
        logs.append(Log.from_arrays(kind, time, inputs, dict(zip(robot.measured_angles, seen.T, strict=True)), robot))
    return LogSet(logs)


@pytest.mark.parametrize("noise", [0.01, pytest.param(0.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["pioneer", pytest.param("omni", marks=pytest.mark.slow)])
def test_angles_give_the_parameters_with_intervals_that_hold_them(name, noise, demo_truth):
    robot = Pioneer(wheel_angles=True) if name == "pioneer" else Omni(wheel_angles=True)
    truth = demo_truth(name)
    logs = measured(robot, name, ("prbs_reversing", "multilevel"), noise, np.random.default_rng(3))
    linear = jaxid.integral_least_squares(robot, logs)
    fit = jaxid.output_error(robot, logs, start=linear)
    assert fit.trustworthy, fit.judgement
    far = {n: (fit[n].value - truth[n]) / fit[n].std_error for n in fit.free_names if fit[n].status == "identified"}
    assert len(far) >= 7 and max(map(abs, far.values())) < 3.5, far
    # The noise found is the sensor's: white, or a step's over the root of 12.
    level = noise or 2 * np.pi / COUNTS / np.sqrt(12)
    assert all(0.85 < found / level < 1.15 for found in fit.noise.values()), (fit.noise, level)


@pytest.mark.slow
def test_angles_tell_more_than_the_speeds_that_follow_from_them(demo_truth):
    """Differences of positions are noise related from sample to sample, which is what a fit of them does not know."""
    robot = Pioneer(wheel_angles=True)
    logs = measured(robot, "pioneer", ("prbs_reversing", "multilevel"), 0.01, np.random.default_rng(4))
    fit = jaxid.output_error(robot, logs)
    inner = slice(1, -1)
    differences = LogSet(
        Log.from_arrays(
            log.name, log.time[inner], log.inputs[inner],
            {n: v[inner] for n, v in measured_velocities(robot, log).items()}, Pioneer(),
        )
        for log in logs
    )  # fmt: skip
    plain = jaxid.output_error(Pioneer(), differences)
    for name in ("I0", "Cs", "Cv"):
        assert fit[name].std_error < 0.3 * plain[name].std_error


def test_what_stands_in_a_log_is_found_by_its_columns(tmp_path):
    robot = Pioneer(wheel_angles=True)
    logs = measured(robot, "pioneer", ("multilevel",), 0.01, np.random.default_rng(5))
    logs[0].to_csv(tmp_path / "wheels.csv")
    read = jaxid.read_logs(tmp_path / "wheels.csv", "pioneer")
    np.testing.assert_array_equal(read[0].output("phi2"), logs[0].output("phi2"))
    assert Pioneer().for_columns(read[0].measured) == robot
    with pytest.raises(LogError, match=r"robot.for_columns\(logs\[0\].measured\)"):
        jaxid.output_error(Pioneer(), read)
    # Beside both speeds angles are left alone, since odometry is often made of them.
    assert Pioneer().for_columns(("eta1", "eta2", "phi2", "phi3")) == Pioneer()


def side(wheel):
    """How the rim speed of one side of a plain drive changes; wheels of radius r on half a track of 0.2 m."""

    def rate(s, u, p, friction):
        force = {k: p["k"] * u[f"u{k}"] / p["r"] - friction[k] / p["r"] - p["B"] * s[f"s{k}"] for k in ("R", "L")}
        v, w = (force["R"] + force["L"]) / p["M"], 0.2 * (force["R"] - force["L"]) / p["J"]
        return v + 0.2 * w if wheel == "R" else v - 0.2 * w

    return rate


def own_drive():
    """A robot of a user's own, whose states are the speeds of its wheels' rims."""
    right, left = side("R"), side("L")

    def dynamics(s, u, p, friction):
        return {"sR": right(s, u, p, friction), "sL": left(s, u, p, friction)}

    table = {
        "M": Parameter(9.0, "kg", free=True), "J": Parameter(0.3, "kg m^2", free=True),
        "B": Parameter(5.0, "N s/m", free=True), "C": Parameter(0.1, "N m", free=True),
        "k": Parameter(0.2, "N m/V"), "r": Parameter(0.08, "m"),
    }  # fmt: skip
    axes = {
        k: DriveAxis(lambda s, p, k=k: s[f"s{k}"] / p["r"], coulomb="C", angle=f"phi{k}", lever="r") for k in ("R", "L")
    }
    return Custom(
        dynamics=dynamics, state_names=("sR", "sL"), own_channels=Channels(("uR", "uL"), ("sR", "sL")), table=table,
        axes=axes, velocities=("sR", "sL"),
    )  # fmt: skip


def test_a_robot_of_ones_own_measures_the_angles_of_its_axes():
    """Against SciPy's integrator, the motors on until the wheels stop for good so that friction keeps its sign."""
    from scipy.integrate import solve_ivp

    robot = own_drive().for_columns(("t", "uR", "uL", "phiR", "phiL"))
    assert robot.channels.measured == ("sR", "sL", "phiR", "phiL") and robot.channels.units["phiR"] == "rad"
    truth = {"M": 12.0, "J": 0.5, "B": 7.0, "C": 0.16}
    p = {**truth, "k": 0.2, "r": 0.08}
    rng, logs = np.random.default_rng(6), []
    for seed in range(2):
        held = 6.0 + np.repeat(np.random.default_rng(seed).uniform(-3, 3, (25, 2)), 20, axis=0)
        time, right, left = 0.01 * np.arange(len(held)), side("R"), side("L")

        def rates(t, x, held=held, right=right, left=left):
            s = {"sR": x[0], "sL": x[1]}
            u = dict(zip(("uR", "uL"), held[min(int(t / 0.01 + 1e-9), len(held) - 1)], strict=True))
            friction = {"R": p["C"], "L": p["C"]}  # both turn forwards throughout
            return [right(s, u, p, friction), left(s, u, p, friction), x[0] / p["r"], x[1] / p["r"]]

        run = solve_ivp(rates, (0, time[-1]), [0.0] * 4, t_eval=time, max_step=0.01, rtol=1e-8, atol=1e-10)
        step = 2 * np.pi / COUNTS
        seen = step * np.floor((run.y[2:] + rng.uniform(0, 9, (2, 1))) / step)
        outputs = {"phiR": seen[0], "phiL": seen[1]}
        logs.append(Log.from_arrays(f"run{seed}", time, held, outputs, robot))
    fit = jaxid.output_error(robot, LogSet(logs))
    assert fit.trustworthy, fit.judgement
    far = {n: (fit[n].value - truth[n]) / fit[n].std_error for n in truth}
    assert max(map(abs, far.values())) < 3.5, far
    assert all(fit[n].std_error < 0.01 * truth[n] for n in truth)
    linear = jaxid.integral_least_squares(robot, LogSet(logs))
    assert all(abs(linear[n].value / truth[n] - 1) < 0.1 for n in truth), linear
