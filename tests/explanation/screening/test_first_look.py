"""jaxid/explanation/screening/first_look.py: windows of outputs that integrate, which must show what is missing."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet
from jaxid.explanation.screening import first_look
from jaxid.logs.windows import Windows

TIME = np.arange(0.0, 40.0, 0.01)


def looked(monkeypatch, shown_from):
    """The lengths [s] of the windows that were fitted in, and of those of the look (None: whole logs), where windows shorter
    than `shown_from` seconds hide what is missing."""
    fitted, seen = [], []

    def refit(robot, starts, windows, *others):
        seconds = max(one.duration for one in windows)
        fitted.append(seconds)
        state = SimpleNamespace(adequate=seconds < shown_from, diverged=())
        return SimpleNamespace(robot=robot, squares=1.0, fitted=state, initial_states={})

    def screen(robot, logs, effects, *others):
        seen.append(max(one.duration for one in logs) if isinstance(logs, Windows) else None)
        return []

    monkeypatch.setattr(first_look, "refit", refit)
    monkeypatch.setattr(first_look, "screen", screen)
    robot = Axis()
    one = Log("a", TIME, np.sin(TIME)[:, None], np.stack([np.full(len(TIME), np.nan), np.cos(TIME)], 1), robot.channels)
    trial = SimpleNamespace(robot=robot, angles=None, fitted=SimpleNamespace(normalised_rms=30.0), initial_states={})
    from jaxid.effects import effect_by_id

    first_look.first_look(trial, LogSet([one]), [effect_by_id(robot, "stribeck_friction")], {}, lambda said: None)
    return fitted, seen[0]


def test_windows_are_short_where_these_show_what_is_missing(monkeypatch):
    fitted, look = looked(monkeypatch, 0.0)
    assert fitted == [look] and look < 2.5


def test_windows_that_hide_it_are_made_longer(monkeypatch):
    shortest = looked(monkeypatch, 0.0)[1]
    fitted, look = looked(monkeypatch, 2.0 * shortest)
    assert len(fitted) == 2 and fitted[0] == shortest
    assert look == pytest.approx(3.0 * shortest, rel=0.02)


def test_where_all_windows_hide_it_the_look_is_at_whole_logs(monkeypatch):
    fitted, look = looked(monkeypatch, 1e9)
    assert look is None and 1 < len(fitted) < 6
