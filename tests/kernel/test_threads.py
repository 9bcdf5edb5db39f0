"""jaxid/kernel/threads.py: every group once, on however many threads."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxid import Axis, integral_least_squares, output_error
from jaxid.kernel import threads
from jaxid.kernel.threads import over_groups


@pytest.fixture(params=[pytest.param(1, marks=pytest.mark.slow), 2, pytest.param(5, marks=pytest.mark.slow)])
def several(request, monkeypatch):
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(request.param) as pool:
        monkeypatch.setattr(threads, "threads", lambda: request.param)
        monkeypatch.setattr(threads, "_pool", lambda: pool)
        monkeypatch.setattr(threads, "_LEAST", 1)
        yield request.param


@pytest.mark.parametrize("groups", [0, 1, 2, 3, 7, 20])
def test_every_group_is_run_once(several, groups):
    count = np.zeros(groups, int)

    def run(some):
        count[some] += 1

    over_groups(run, groups, 100)
    assert (count == 1).all()


def test_what_fails_in_a_thread_is_raised(several):
    def run(some):
        if some.stop == 10:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        over_groups(run, 10, 100)


def test_a_little_work_stays_where_it_is(monkeypatch):
    monkeypatch.setattr(threads, "_pool", lambda: SimpleNamespace(submit=None))
    parts = []
    over_groups(parts.append, 3, 100)
    assert parts == [slice(0, 3)]


def test_a_fit_is_the_same_to_the_last_digit(several, axis_log):
    rng = np.random.default_rng(3)
    logs = [axis_log(str(k), 4.0 * rng.choice([-1.0, 1.0], 8).repeat(25), noise=0.01, seed=k) for k in range(20)]
    found = output_error(Axis(), logs, start=integral_least_squares(Axis(), logs))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(threads, "threads", lambda: 1)
        alone = output_error(Axis(), logs, start=integral_least_squares(Axis(), logs))
    assert {n: found[n].value for n in found.free_names} == {n: alone[n].value for n in alone.free_names}


@pytest.mark.parametrize("said, wanted", [("1", 1), ("1,2", 1), ("x", None), ("0", 1), ("4096", None)])
def test_openmp_says_how_many(monkeypatch, said, wanted):
    import os

    monkeypatch.setenv("OMP_NUM_THREADS", said)
    threads.threads.cache_clear()
    assert threads.threads() == (wanted or len(os.sched_getaffinity(0)))
    threads.threads.cache_clear()
