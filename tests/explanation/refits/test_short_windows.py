"""Refits that begin where short windows lead: an axis under a position servo, of which whole logs lead astray."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.refits import short_windows
from jaxid.explanation.refits.short_windows import needs_the_past, starts_from, windows_to_look_in

DT, STEP = 0.005, 2e-5
M, FV, FC, RISE, SPEED = 95.0, 203.0, 20.4, 8.0, 0.004


def servoed(seed, seconds=8.0):
    """Positions by a counter, of an axis with Stribeck friction that sticks, under a servo that follows smooth strokes."""
    rng, fine = np.random.default_rng(seed), 25
    count = round(seconds / DT)
    legs = np.repeat(rng.uniform(-0.1, 0.1, 8), -(-count // 8))[:count]
    wanted = np.convolve(np.append(np.full(99, legs[0]), legs), np.ones(100) / 100.0, mode="valid")
    wanted -= wanted[0]
    q = v = last = 0.0
    read, force = [], []
    for goal in wanted:
        seen = STEP * np.round(q / STEP)
        u = 2000.0 * (20.0 * (goal - seen) - (seen - last) / DT)
        last, u = seen, float(np.clip(u, -350.0, 350.0))
        read.append(seen)
        force.append(u)
        h = DT / fine
        for _ in range(fine):
            middle = v
            for _ in range(3):  # friction as of the speed halfway, to which it comes; it stops no more than there is
                held = FC + RISE * np.exp(-((middle / SPEED) ** 2))
                free = v * (M - 0.5 * h * FV) + h * u
                after = np.sign(free) * max(abs(free) - h * held, 0.0) / (M + 0.5 * h * FV)
                middle = 0.5 * (v + after)
            q, v = q + h * middle, after
    return Log.from_arrays(f"run {seed}", DT * np.arange(count), np.array(force)[:, None], {"q": np.array(read)}, AXIS)


@pytest.mark.slow
def test_stribeck_friction_under_a_position_servo_is_found_exactly():
    """Simulated freely, the fit without it is thousands of counts off, and so is one with it from nearly anywhere."""
    logs, held_out = LogSet([servoed(k) for k in range(3)]), LogSet([servoed(k) for k in (7, 8)])
    robot = Axis().with_values(M=80.0, Fv=150.0, Fc=10.0, offset=0.0).change("offset", free=False)
    found = explain(output_error(robot, logs), logs, held_out)
    assert [effect.id for effect in found.effects] == ["stribeck_friction"] and found.verdict in ("named", "ambiguous")
    assert found.before.normalised_rms > 100 and found.after.normalised_rms < 3
    for name, truth in {"M": M, "Fv": FV, "Fc": FC, "stribeck_friction.amplitude": RISE}.items():
        assert found.final[name].value == pytest.approx(truth, rel=0.02), name


def trial(off, robot=None):
    return SimpleNamespace(robot=robot or Axis(), angles=None, fitted=SimpleNamespace(normalised_rms=off))


def positions(column="q"):
    time = np.arange(0.0, 40.0, 0.01)
    return LogSet([Log.from_arrays("a", time, np.sin(time)[:, None], {column: np.cos(time)}, AXIS)])


def test_there_are_windows_where_positions_are_far_off_and_nowhere_else():
    assert windows_to_look_in(trial(30.0), positions()) is not None
    assert windows_to_look_in(trial(2.0), positions()) is None
    assert windows_to_look_in(trial(30.0), positions("v")) is None


def test_a_refit_begins_where_its_windows_lead_too_unless_the_effect_needs_what_came_before_them(monkeypatch):
    led_to, windows = Axis().with_values(M=3.0), windows_to_look_in(trial(30.0), positions())
    monkeypatch.setattr(short_windows, "refit", lambda robot, *given: SimpleNamespace(robot=led_to, squares=1.0))
    start, stribeck = {"M": 2.0}, Axis() + effect_by_id(Axis(), "stribeck_friction")
    found = starts_from(stribeck, [start], windows, {})
    assert found[0] == start and len(found) == 2 and found[1]["M"] == 3.0
    assert starts_from(stribeck, [start], None, {}) == [start]
    late = Axis() + effect_by_id(Axis(), "input_delay")
    assert starts_from(late, [start], windows, {}) == [start]
    assert needs_the_past(late.effects[-1], late) and not needs_the_past(stribeck.effects[-1], stribeck)
    zone = Axis() + effect_by_id(Axis(), "actuator_dead_zone")
    assert not needs_the_past(zone.effects[-1], zone)  # what is lost of a command hangs on no earlier one
    monkeypatch.setattr(short_windows, "refit", lambda robot, *given: SimpleNamespace(robot=led_to, squares=np.inf))
    assert starts_from(stribeck, [start], windows, {}) == [start]
