"""The omni paper's methods on logs of simulated experiments: the truth recovered, and what of a log is used."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from jaxid.estimate.result import Estimate
from jaxid.logs import OMNI, Log, LogError, LogSet, read_logs
from jaxid.papers.omni import tables as omni_tables
from jaxid.papers.omni.experiments import method_1, method_2
from jaxid.papers.omni.hanging import method_3, read_hanging
from jaxid.papers.omni.stretches import currents, force_free_stretch, forces, steady_stretches
from jaxid.robots import Omni

DEMO = Path(__file__).parents[3] / "jaxid/demo_logs/omni_paper"
TRUTH = dict(Bv=3.73, Bvn=3.34, Bw=0.73, Cv=29.45, Cvn=29.61, Cw=5.12, J=1.374)
M = 35.0


@pytest.fixture(scope="module")
def demo():
    return {
        "steady": read_logs(DEMO / "steady_*.csv", robot="omni"),
        "coast": read_logs(DEMO / "coast_*.csv", robot="omni"),
        "hanging": read_hanging(DEMO / "hanging_*.csv"),
    }


def within(estimate: Estimate, truth: float) -> None:
    assert abs(estimate.value - truth) < 3.5 * estimate.std_error, (estimate, truth)


def test_methods_recover_the_truth_from_independently_simulated_logs(demo):
    first = method_1(demo["steady"])
    assert set(first.friction) == {"V", "Vn", "W"}
    assert {point.log for point in first.points} == set(demo["steady"].names)
    for point in first.points:  # settled for three time constants, and the force is what friction takes at that speed
        assert point.start > 0.8
        viscous, coulomb = {"V": ("Bv", "Cv"), "Vn": ("Bvn", "Cvn"), "W": ("Bw", "Cw")}[point.axis]
        expected = TRUTH[viscous] * point.speed + TRUTH[coulomb]
        assert abs(point.force - expected) < 4 * point.force_error
    for friction in first.friction.values():
        for name, estimate in friction.estimates.items():
            within(estimate, TRUTH[name])
            assert estimate.std_error < 0.06 * TRUTH[name]

    second = method_2(demo["coast"], first)
    assert {name: axis for name, (axis, _, _) in second.stretches.items()} == {
        "coast_V.csv": "V", "coast_Vn.csv": "Vn", "coast_W.csv": "W",
    }  # fmt: skip
    for _, start, stop in second.stretches.values():  # the motors are disconnected at 2 s
        assert start == pytest.approx(2.0, abs=0.03) and stop > 2.3
    for friction in second.friction.values():
        for name, estimate in friction.estimates.items():
            within(estimate, TRUTH[name])
    assert second.inertia is not None
    within(second.inertia.J, TRUTH["J"])

    third = method_3(demo["hanging"])
    for found in third.experiments.values():
        within(found.J, TRUTH["J"])
    within(third.mean, TRUTH["J"])
    summary = omni_tables.Summary(first, second, third)
    assert list(summary.parameters) == ["Bv", "Bvn", "Bw", "Cv", "Cvn", "Cw", "J"]
    assert summary.robot().parameters["J"].value == summary.parameters["J"].value
    for shown in (first, second, third, summary, first.table_1):
        assert "paper" in repr(shown) and "<table>" in shown._repr_html_()


def simulated(u, friction=TRUTH, duration=4.0, cut=None, noise=(0.0, 0.0), seed=0, name="run.csv", with_currents=True):
    """An omni log by SciPy: wheel voltages `u` (4,), motors disconnected at `cut`; forwards motion, so no sticking."""
    p = Omni().parameters.numbers
    t = np.round(np.arange(0, duration, 0.02), 10)
    rng = np.random.default_rng(seed)

    def current(y, on):
        V, Vn, W = y
        rim = np.array([Vn + p["b"] * W, -V + p["b"] * W, -Vn + p["b"] * W, V + p["b"] * W])
        return on * (np.asarray(u) - p["Kv"] * p["l"] * rim / p["r"]) / p["Ra"]

    def right(_, y, on):
        f = p["l"] * p["Kt"] / p["r"] * current(y, on)
        drive = np.array([f[3] - f[1], f[0] - f[2], p["b"] * f.sum()])
        B = np.array([friction["Bv"], friction["Bvn"], friction["Bw"]])
        C = np.array([friction["Cv"], friction["Cvn"], friction["Cw"]])
        free = drive - B * y
        turning = np.array([M * y[2] * y[1], -M * y[2] * y[0], 0.0])
        # A speed at rest stays there while the drive is below the Coulomb level; those that move only go one way here.
        resting = (np.abs(y) < 1e-9) & (np.abs(free) < C)
        force = np.where(resting, 0.0, free + turning - C * np.sign(np.where(np.abs(y) < 1e-9, free, y)))
        return force / np.array([M, M, friction["J"]])

    speeds, i, y = [], [], np.zeros(3)
    for k in range(len(t)):
        on = float(cut is None or t[k] < cut)
        speeds.append(y)
        i.append(current(y, on))
        after = solve_ivp(right, (0, 0.02), y, args=(on,), rtol=1e-9, atol=1e-12).y[:, -1]
        y = after if on else np.where(after * y < 0, 0.0, after)
        if not on and np.max(np.abs(y)) < 0.03:
            y = np.zeros(3)
    speeds = np.array(speeds) + noise[0] * rng.standard_normal((len(t), 3))
    i = np.array(i) + noise[1] * rng.standard_normal((len(t), 4))
    volts = np.where((t < (np.inf if cut is None else cut))[:, None], np.asarray(u, float), 0.0)
    return Log.from_arrays(name, t, volts, np.hstack([speeds, i]) if with_currents else speeds, OMNI)


def drive(axis, speed):
    p = Omni().parameters.numbers
    lever, motors = (p["b"], 4) if axis == "W" else (1.0, 2)
    B, C = {"V": ("Bv", "Cv"), "Vn": ("Bvn", "Cvn"), "W": ("Bw", "Cw")}[axis]
    i = (TRUTH[B] * speed + TRUTH[C]) / (motors * lever * 6.0)
    u = 0.6 * i + 6.0 * lever * speed
    return u * np.array({"V": [0, -1, 0, 1], "Vn": [1, 0, -1, 0], "W": [1, 1, 1, 1]}[axis])


def test_currents_computed_by_the_motor_model_serve_where_none_were_logged():
    logs = [
        simulated(drive(axis, v), name=f"{axis}{v}.csv", with_currents=logged)
        for axis in ("V", "W")
        for v in (0.6, 0.8, 1.0)
        for logged in (False,)
    ]
    assert currents(logs[0])[1] is False
    first = method_1(logs)
    for friction in first.friction.values():
        for name, estimate in friction.estimates.items():
            assert estimate.value == pytest.approx(TRUTH[name], rel=2e-3)
    measured = simulated(drive("V", 0.8))
    assert currents(measured)[1] is True
    np.testing.assert_allclose(forces(measured), forces(simulated(drive("V", 0.8), with_currents=False)), atol=1e-9)


def test_force_free_stretch_starts_where_the_motors_were_cut():
    log = simulated(drive("W", 3.0), cut=2.0, duration=3.0, noise=(0.005, 0.05), seed=3)
    axis, stretch = force_free_stretch(log)
    assert axis == "W"
    assert log.time[stretch.start] == pytest.approx(2.0, abs=0.021)
    assert np.all(np.abs(log.output("W")[stretch]) > 0.0) and log.time[stretch.stop - 1] < 2.7


def test_no_steady_stretch_in_a_run_that_never_settles():
    t = np.arange(0, 4, 0.02)
    speeds = np.stack([0.3 * t, 0 * t, 0 * t], axis=1)
    ramp = Log.from_arrays("ramp.csv", t, np.zeros((len(t), 4)), np.hstack([speeds, np.zeros((len(t), 4))]), OMNI)
    assert steady_stretches(ramp) == []
    with pytest.raises(LogError, match="No log has a steady stretch"):
        method_1([ramp])


@pytest.mark.parametrize(("tail", "earliest", "latest"), [(0.0, 0.0, 1.01), (0.02, 2.0, 4.5)])
def test_a_slow_approach_to_a_speed_is_not_steady(tail, earliest, latest):
    """A controller's integrator settles within seconds: 0.02 m/s of it are M dv/dt = 0.7 N, as much as 0.2 m/s of Bv."""
    t, rng = np.arange(0, 6, 0.02), np.random.default_rng(4)
    speeds = np.stack([1.0 + tail * np.exp(-t), 0 * t, 0 * t], axis=1) + 0.002 * rng.standard_normal((len(t), 3))
    log = Log.from_arrays("tail.csv", t, np.zeros((len(t), 4)), np.hstack([speeds, np.zeros((len(t), 4))]), OMNI)
    (stretch,) = steady_stretches(log)
    assert earliest <= log.time[stretch.start] <= latest and log.time[stretch.stop - 1] > 5.9


def test_what_method_1_passes_over_is_said(demo):
    both = simulated(drive("V", 0.8) + drive("Vn", 0.9), name="both.csv", noise=(0.01, 0.05))
    still = simulated(np.zeros(4), name="still.csv", noise=(0.01, 0.05), duration=3.0)
    first = method_1([*demo["steady"], both, still])
    assert any("both.csv" in note and "V and Vn at once" in note for note in first.notes)
    assert any("still.csv" in note for note in first.notes)
    assert first.friction["V"].viscous == method_1(demo["steady"]).friction["V"].viscous


def test_coast_down_logs_that_cannot_be_used(demo):
    with pytest.raises(LogError, match="coast_W|friction of W"):
        method_2([demo["coast"]["coast_W.csv"]])
    with pytest.raises(LogError, match="steady_V_1.0.csv has no 10 samples.*switch the motors off"):
        force_free_stretch(demo["steady"]["steady_V_1.0.csv"])
    blind = simulated(drive("V", 1.2), cut=2.0, duration=3.5, with_currents=False, name="blind.csv")
    with pytest.raises(LogError, match="blind.csv.*log i1..i4"):
        force_free_stretch(blind)
    with pytest.raises(LogError, match="no omni log"):
        steady_stretches(demo["hanging"][0])


def test_hanging_logs_in_files(tmp_path, demo):
    plain = pd.read_csv(DEMO / "hanging_1.csv")[["t", "theta"]].to_csv(index=False)
    (tmp_path / "header.csv").write_text("# hanging robot, mass [kg] = 0.510\n" + plain)
    logs = read_hanging([DEMO / "hanging_1.csv", tmp_path / "header.csv"])
    assert isinstance(logs, LogSet)
    column, header = method_3(logs).experiments.values()
    assert header.J == column.J

    def fails(text, words):
        (tmp_path / "bad.csv").write_text(text)
        with pytest.raises(LogError, match=words):
            method_3(read_hanging(tmp_path / "bad.csv"))

    fails(plain, "neither a column 'mass'")
    fails("# mass = heavy\n" + plain, "'heavy', which is no number")
    fails("t,mass\n0,1\n1,1\n2,1\n", "theta")
    fails("t,theta,mass\n0,0,1\n1,x,1\n2,2,1\n3,3,1\n", "theta.*'x'.*line 3")
    fails("t,theta,mass\n0,0,1\n1,1,1\n2,3,2\n3,6,2\n", "bad.csv: column 'mass' changes at sample 2")
    fails("t,theta,mass\n0,0,-1\n1,1,-1\n2,3,-1\n3,6,-1\n", "above zero")
    fails("t,theta,mass\n0,0,1\n1,1,1\n1,3,1\n3,6,1\n", "repeats the previous time")
    with pytest.raises(LogError, match="No file matches"):
        read_hanging(tmp_path / "nothing_*.csv")
    with pytest.raises(LogError, match="read it with read_hanging"):
        method_3(demo["coast"])


def test_half_logged_currents_are_refused(tmp_path):
    frame: pd.DataFrame = simulated(drive("V", 0.8), duration=1.0).to_frame().drop(columns=["i3", "i4"])
    frame.to_csv(tmp_path / "half.csv", index=False)
    with pytest.raises(LogError, match=r"half.csv has the currents \['i1', 'i2'\] and lacks \['i3', 'i4'\]"):
        method_1(read_logs(tmp_path / "half.csv", robot="omni"))
