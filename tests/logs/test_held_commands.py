"""jaxid/logs/held_commands.py: commands that a table writes only now and then are held; those that were lost are not."""

import numpy as np
import pandas as pd
import pytest

from jaxid import LogError, read_logs

T = 0.005 * np.arange(400)
STEPS = np.repeat([2.0, -1.5, 0.0, 3.0, 1.0], 80)


def written(path, command, speed=None):
    frame = pd.DataFrame({"t": T, "u": command, "v": np.sin(T) if speed is None else speed})
    frame.to_csv(path, index=False)
    return path


def only_at_changes(command):
    return np.where(np.append(True, np.diff(command) != 0), command, np.nan)


def findings(logs, check):
    return [finding for finding in logs.preflight() if finding.check == check]


def test_steps_that_are_written_when_they_change(tmp_path):
    """Beside a sensor that is slower than the table."""
    slow = np.where(np.arange(400) % 4 == 0, np.sin(T), np.nan)
    logs = read_logs(written(tmp_path / "run.csv", only_at_changes(STEPS), slow), "axis")
    assert np.array_equal(logs[0].input("u"), STEPS)
    (note,) = findings(logs, "held_command")
    assert note.severity == "note" and "'u' is written in 5 of 400 rows" in note.message


def test_commands_at_a_rate_of_their_own_and_where_they_stayed_away(tmp_path):
    """Every tenth row; then the same without those from 0.5 to 1 s, which a warning says."""
    wave = np.repeat(np.sin(3 * T[::10]), 10)
    every = np.where(np.arange(400) % 10 == 0, wave, np.nan)
    logs = read_logs(written(tmp_path / "run.csv", every), "axis")
    assert np.array_equal(logs[0].input("u"), wave)
    away = np.where((T > 0.47) & (T < 1.0), np.nan, every)
    with pytest.warns(match="comes every 0.05 s, came for 0.55 s"):
        logs = read_logs(written(tmp_path / "away.csv", away), "axis")
    assert findings(logs, "held_command")[0].severity == "warning"
    assert np.array_equal(logs[0].input("u")[T >= 1.0], wave[T >= 1.0])


def test_a_full_column_that_breaks_off_is_an_error_unless_the_mapping_says_that_it_is_held(tmp_path):
    """A person's lever: it changes in row after row, then rests."""
    lever = np.where(T < 0.3, np.sin(20 * T), np.sin(20 * 0.3))
    path = written(tmp_path / "run.csv", only_at_changes(lever))
    with pytest.raises(LogError, match=r"'u'.* gap of .*only written when it changed, map u = \{ held = true \}"):
        read_logs(path, "axis")
    logs = read_logs(path, "axis", mapping={"u": {"held": True}})
    assert np.allclose(logs[0].input("u"), lever) and len(findings(logs, "held_command")) == 1


def test_what_was_applied_before_the_first_command_is_not_known(tmp_path):
    late = only_at_changes(STEPS)
    late[0] = np.nan
    for mapping in (None, {"u": {"held": True}}):
        with pytest.raises(LogError, match="no value at sample 0"):
            read_logs(written(tmp_path / "run.csv", late), "axis", mapping=mapping)
