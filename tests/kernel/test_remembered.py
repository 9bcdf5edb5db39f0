"""jaxid/kernel/remembered.py: what another process compiled is found again, and only that."""

import numpy as np
import pytest

import jaxid
from jaxid import _kept
from jaxid.kernel import call, direct, machine, remembered, traced
from jaxid.simulation.direct import _model
from jaxid.simulation.machine_rollout import system_of

ALIVE = []
"""Engines: XLA's programs and kept functions go on pointing to code that was loaded again under its name."""


@pytest.fixture
def as_in_a_new_process(monkeypatch, tmp_path):
    """A function that forgets what this process has compiled; what is compiled is kept in a folder of its own."""
    monkeypatch.setattr(remembered, "folder", lambda: tmp_path)
    monkeypatch.setattr(machine, "folder", lambda: tmp_path)
    before = dict(machine._engines)

    def forget():
        ALIVE.extend(machine._engines.values())
        machine._engines.clear()
        for known in (call.machine_code, direct._rollout, traced.traced, system_of, _model):
            known.cache_clear()

    yield forget
    forget()
    machine._engines.update(before)


def _simulated(forget, logs):
    forget()
    return jaxid.simulate(jaxid.Axis(), logs)


@pytest.fixture
def logs(axis_log):
    return jaxid.LogSet([axis_log("a", 3.0 * np.sign(np.sin(np.arange(200) / 17.0)), position=False)])


def test_nothing_is_traced_again(as_in_a_new_process, logs, monkeypatch, tmp_path):
    first = _simulated(as_in_a_new_process, logs)
    assert list(tmp_path.glob("jaxid_*.json")) and list(tmp_path.glob("jaxid_*.code"))

    def refuse(*arguments):
        raise AssertionError("traced again")

    monkeypatch.setattr(call, "program", refuse)
    again = _simulated(as_in_a_new_process, logs)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))


@pytest.mark.parametrize("spoil", ["{", "[]", '{"code": ["jaxid_of_nothing"], "numbers": []}', '{"code": 3}'])
def test_a_spoilt_file_or_one_whose_code_is_gone_is_made_anew(as_in_a_new_process, logs, tmp_path, spoil):
    first = _simulated(as_in_a_new_process, logs)
    for path in tmp_path.glob("jaxid_*.json"):
        path.write_text(spoil)
    again = _simulated(as_in_a_new_process, logs)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert all('"numbers"' in path.read_text() and spoil != path.read_text() for path in tmp_path.glob("jaxid_*.json"))


@pytest.mark.parametrize("part", [0.0, 0.5, 0.99])
def test_code_of_which_a_part_is_there_is_compiled_anew(as_in_a_new_process, logs, tmp_path, part):
    """As after a power failure: LLVM would crash on it."""
    first = _simulated(as_in_a_new_process, logs)
    whole = {path: path.read_bytes() for path in tmp_path.glob("jaxid_*.code")}
    for path, code in whole.items():
        path.write_bytes(code[: int(part * len(code))])
    again = _simulated(as_in_a_new_process, logs)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert whole and all(path.read_bytes() == code for path, code in whole.items())


def test_a_model_without_identity_is_not_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(remembered, "folder", lambda: tmp_path)
    assert remembered.remembered(None, "x", lambda: remembered.Made((), (1, 2))).numbers == (1, 2)
    assert not list(tmp_path.iterdir())


def test_numbers_come_back(tmp_path, monkeypatch):
    monkeypatch.setattr(remembered, "folder", lambda: tmp_path)
    made = iter([remembered.Made((), (3,)), remembered.Made((), (4,))])
    found = [remembered.remembered("one", purpose, lambda: next(made)).numbers for purpose in ("a", "a", "b", "a")]
    assert found == [(3,), (3,), (4,), (3,)]


def test_the_oldest_files_make_room(tmp_path, monkeypatch):
    import os

    monkeypatch.setattr(_kept, "_MOST_FILES", 4)
    for number in range(6):
        path = tmp_path / f"jaxid_{number}.code"
        path.touch()
        os.utime(path, (number, number))
    (tmp_path / "of_jax").touch()
    _kept.make_room(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "jaxid_3.code",
        "jaxid_4.code",
        "jaxid_5.code",
        "of_jax",
    ]
