"""The moving window against fits of whole logs, changes that were made, and chance."""

import time

import numpy as np
import pytest
from scipy import signal

from jaxid import Axis, DifferentialDrive, Log, LogSet, MovingWindow, ParameterError, output_error
from jaxid.estimate.output_error import moving_window
from jaxid.estimate.output_error.change import Knowledge, change

NOISE, INTERVAL = 0.01, 0.02
TRUE = {"M": 1.0, "Fv": 2.0, "Fc": 0.5, "offset": 0.0}


def recorded(seconds, seed=0, changed=None, after=np.inf, still=np.inf, again=np.inf, related=0.0):
    """Time, force and speed of a cart with dry friction, in steps of a fiftieth of a sample; `changed` parameters from `after`
    on, no force from `still` until `again`; noise that is `related` from sample to sample."""
    random, T, fine = np.random.default_rng(seed), int(seconds / INTERVAL), 50
    force, h, v, speeds = np.repeat(random.uniform(-6, 6, T // 25 + 1), 25)[:T], INTERVAL / 50, 0.0, []
    there = INTERVAL * np.arange(T)
    force[(there >= still) & (there < again)] = 0.0
    for k in range(T):
        speeds.append(v)
        p = TRUE | (changed or {} if k * INTERVAL >= after else {})
        for _ in range(fine):
            ahead = v + h / p["M"] * (force[k] - p["Fv"] * v)
            most = h / p["M"] * p["Fc"]
            v = ahead - np.clip(ahead, -most, most)
    noise = random.normal(size=(T, 1))
    if related:
        noise = signal.lfilter([np.sqrt(1.0 - related**2)], [1.0, -related], noise, axis=0)
    return INTERVAL * np.arange(T), force[:, None], np.array(speeds)[:, None] + NOISE * noise


def followed(run, window, every=25):
    fits = []
    for k in range(0, len(run[0]), every):
        window.add(*(values[k : k + every] for values in run))
        if window.full:
            fits.append(window.refit())
    return fits


def test_one_window_is_output_error_of_its_samples():
    run = recorded(4.0)
    window = MovingWindow(Axis(), 3.98, noise={"v": NOISE})
    window.add(*run)
    found = window.refit()
    robot = Axis().with_values(**found.values)
    fit = output_error(robot, LogSet([Log.from_arrays("run", *run, robot)]), initial_states="estimate", windows=None)
    assert found.sound and np.isnan(found.p_value) and found.changed == ()
    assert found.normalised_rms == pytest.approx(1.0, abs=0.1)
    for name, value in found.values.items():
        # The noise is given here and estimated there.
        assert abs(value - fit[name].value) < 0.1 * fit[name].std_error
        assert found.std_errors[name] == pytest.approx(fit[name].std_error, rel=0.2)


def test_a_payload_is_told_named_and_followed():
    run = recorded(24.0, changed={"M": 1.4}, after=12.0)
    window = MovingWindow(Axis(), 3.0, noise={"v": NOISE}, memory=20.0)
    begun, fits = time.process_time(), []
    for k in range(0, len(run[0]), 25):
        window.add(*(values[k : k + 25] for values in run))
        if window.full:
            fits.append(window.refit())
            if fits[-1].changed:
                window.forget(fits[-1].changed)
    assert (time.process_time() - begun) / len(fits) < 0.1  # measured: 4 ms
    alarms, named = [fit for fit in fits if fit.alarm], [fit for fit in fits if fit.changed]
    assert 12.0 < alarms[0].time < 13.0 and not alarms[0].sound
    assert 14.9 <= named[0].time < 16.0 and [fit.changed for fit in named] == [("M",)]
    assert alarms[-1] is named[0]
    for fit, mass in ((fits[15], 1.0), (fits[-1], 1.4)):
        assert abs(fit.values["M"] - mass) < 4 * fit.std_errors["M"] < 0.02


def test_of_more_parameters_than_can_be_tried_the_difference_tells(monkeypatch):
    monkeypatch.setattr(moving_window, "_MOST_TRIED", 3)
    window = MovingWindow(Axis(), 3.0, noise={"v": NOISE}, memory=20.0)
    fits = followed(recorded(18.0, changed={"M": 1.4}, after=9.0), window)
    named = [fit.changed for fit in fits if fit.changed]
    assert named[0] == ("M",)


@pytest.mark.parametrize(("name", "to"), [("Fc", 0.8), ("M", 1.4), ("Fv", 2.6)])
def test_what_changes_while_the_cart_stands_is_named_and_nothing_else(name, to):
    """A window that holds little but standstill follows anything; no parameter of one that calls itself sound is far off."""
    run = recorded(36.0, 3, changed={name: to}, after=15.0, still=12.0, again=15.0)
    window, named = MovingWindow(Axis(), 4.0, noise={"v": NOISE}, memory=20.0), []
    for k in range(0, len(run[0]), 25):
        window.add(*(values[k : k + 25] for values in run))
        if not window.full:
            continue
        fit = window.refit()
        truth = TRUE | ({name: to} if fit.time > 15.0 else {})
        if fit.sound and not 15.0 <= fit.time < 15.6:  # nothing shows yet
            told = [n for n in fit.informed if fit.std_errors[n] > 0]
            assert all(abs(fit.values[n] - truth[n]) < 5 * fit.std_errors[n] for n in told), fit
        if fit.changed:
            named.append(fit.changed)
            window.forget(fit.changed)
    assert len(named) == 1 and name in named[0] and set(named[0]) <= {name, "offset"}


def test_a_silent_sensor_does_not_make_up_for_what_another_has_too_much():
    """A cart with a gyro, straight ahead: the gyro reads zero, and the speed scatters by a quarter more than its noise."""
    time_, force, speed = recorded(6.0)
    robot = DifferentialDrive().with_values(M=1.0, J=0.1, Fv=1.0, Fc=0.25)
    random = np.random.default_rng(3)
    for scatter, sound in ((0.0, True), (0.75, False)):
        more = speed + scatter * NOISE * random.normal(size=speed.shape)
        window = MovingWindow(robot, 3.0, noise={"v": NOISE, "w": 0.02})
        outputs = np.concatenate([more, np.zeros_like(speed)], axis=1)
        fits = followed((time_, np.repeat(force / 2, 2, axis=1), outputs), window)
        assert [fit.sound for fit in fits] == [sound] * len(fits)
        assert all(fit.normalised_rms < 1.0 for fit in fits)


@pytest.mark.parametrize("mass", [1e-3, 0.02, 200.0])
def test_a_window_comes_back_from_where_a_sensor_that_failed_led_it(mass):
    """A frozen speed asks for hardly any mass, or for very much; from there simulations diverge, or no step leads back."""
    run = recorded(16.0, seed=2)
    window = MovingWindow(Axis(), 3.0, noise={"v": NOISE}, memory=20.0)
    before = followed([values[:400] for values in run], window)[-1]
    assert before.sound
    window._theta = np.where(np.array(window.names) == "M", mass, 50.0 * window._theta)
    window._last = None
    (after,) = followed([values[400:425] for values in run], window)
    assert after.sound and abs(after.values["M"] - TRUE["M"]) < 3.0 * after.std_errors["M"]


@pytest.mark.slow
@pytest.mark.parametrize("related", [0.8, 0.95])
def test_coloured_noise_is_no_change_and_no_certainty(related):
    fits, off = [], []
    for seed in range(3):
        own = followed(
            recorded(24.0, seed, related=related), MovingWindow(Axis(), 4.0, noise={"v": NOISE}, memory=20.0)
        )
        fits += own
        off += [(f.values[n] - TRUE[n]) / f.std_errors[n] for f in own[::8] for n in ("M", "Fv", "Fc")]
    assert sum(fit.alarm for fit in fits) <= 3 and not any(fit.changed for fit in fits)
    assert sum(fit.sound for fit in fits) > 0.95 * len(fits)
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 1.3


def test_a_payload_is_told_in_coloured_noise():
    run = recorded(24.0, changed={"M": 1.4}, after=12.0, related=0.8)
    fits = followed(run, MovingWindow(Axis(), 3.0, noise={"v": NOISE}, memory=20.0))
    first = next(fit for fit in fits if fit.alarm)
    assert 12.0 < first.time < 14.0
    (named,) = {fit.changed for fit in fits if fit.changed}
    assert named == ("M",)


def test_what_a_window_does_not_excite_stays_where_it_was_seen():
    run = recorded(16.0, still=8.0)
    remembering = followed(run, MovingWindow(Axis(), 3.0, noise={"v": NOISE}, memory=30.0))[-1]
    alone = followed(run, MovingWindow(Axis(), 3.0, noise={"v": NOISE}))[-1]
    assert {"M", "Fv"}.isdisjoint(remembering.informed + alone.informed)
    for name in ("M", "Fv"):
        assert abs(remembering.values[name] - TRUE[name]) < 4 * remembering.std_errors[name] < 0.1
        assert not alone.std_errors[name] < 10 * remembering.std_errors[name]


def test_changes_by_chance_are_as_rare_as_said():
    random, n, draws = np.random.default_rng(2), 3, 2000
    size = np.array([1.0, 1e-3, 50.0])
    A, B = (random.normal(size=(30, n)) / size for _ in range(2))
    A[:, 2] = 0.0  # shows nothing of the last one
    old, new = A.T @ A, B.T @ B
    truth, p = size * [1.0, 2.0, -1.0], []
    for _ in range(draws):
        pulls = [M @ truth + np.linalg.cholesky(M + 1e-30 * np.eye(n)) @ random.normal(size=n) for M in (old, new)]
        before, now = (
            Knowledge(0.0, np.linalg.lstsq(M, b, rcond=1e-12)[0], M, b, M)
            for M, b in zip((old, new), pulls, strict=True)
        )
        p.append(change(before, now, size, 0.01).p_value)
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.015)
    assert np.mean(p) == pytest.approx(0.5, abs=0.03)


def test_bad_input():
    with pytest.raises(ValueError, match="no noise is given for v"):
        MovingWindow(Axis(), 1.0, noise={})
    with pytest.raises(ValueError, match="a window of -1.0 s"):
        MovingWindow(Axis(), -1.0, noise={"v": 1.0})
    held = Axis()
    for name in held.parameters.free_names:
        held = held.change(name, free=False)
    with pytest.raises(ParameterError):
        MovingWindow(held, 1.0, noise={"v": 1.0})
    window = MovingWindow(Axis(), 1.0, noise={"v": 1.0})
    with pytest.raises(ValueError, match="not full"):
        window.refit()
    with pytest.raises(ValueError, match="do not fit"):
        window.add(0.0, [1.0, 2.0], [0.0])
    window.add(0.0, [1.0], [0.0])
    with pytest.raises(ValueError, match="must rise"):
        window.add(0.0, [1.0], [0.0])
    with pytest.raises(ValueError, match="not among"):
        window.forget(["m"])


def test_a_window_that_moved_one_way_alone_is_no_measure_for_the_next():
    """It ends as the cart begins to turn round: the few samples of that tell dry friction from an offset by slopes that hold
    nowhere else."""
    steps = (
        (0.0, 25),
        (4.4, 18),
        (8.3, 32),
        (-1.1, 57),
        (8.0, 28),
        (5.5, 57),
        (9.0, 55),
        (-2.8, 35),
        (-1.2, 13),
        (4.5, 20),
    )
    steps += (8.7, 41), (-5.0, 44), (0.0, 29), (8.8, 37), (-3.5, 42)
    force, v, speeds = np.concatenate([np.full(samples, level) for level, samples in steps]), 0.0, []
    mass, viscous, dry, h = 2.0, 4.0, 1.2, INTERVAL / 50
    for u in force:
        speeds.append(v)
        for _ in range(50):
            ahead = v + h / mass * (u - viscous * v)
            v = ahead - np.clip(ahead, -h / mass * dry, h / mass * dry)
    robot, alarms = Axis().with_values(M=mass, Fv=viscous, Fc=dry), 0
    for seed in range(20):
        noise = NOISE * np.random.default_rng(seed).normal(size=(len(force), 1))
        run = (INTERVAL * np.arange(len(force)), force[:, None], np.array(speeds)[:, None] + noise)
        alarms += any(fit.alarm for fit in followed(run, MovingWindow(robot, 4.0, noise={"v": NOISE})))
    assert alarms <= 1


def test_of_windows_that_are_fitted_at_every_sample_few_are_kept_whole():
    time, force, speed = recorded(12.0, seed=3)
    window = MovingWindow(Axis().with_values(**TRUE), 2.0, noise={"v": NOISE})
    followed((time, force, speed), window, every=1)
    assert len(window._past) > 90 and 8 <= len(window._windows) <= 12
    assert window._windows[0].time <= window._rows[0, 0] < window._windows[1].time
