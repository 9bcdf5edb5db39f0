"""jaxid/_dask.py: work that processes die of is done all the same, once; and what is said without Dask."""

import builtins

import pytest

from jaxid._dask import Lost, on_this_machine, worked_off

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.filterwarnings("ignore")  # those of the libraries' own event loops


@pytest.fixture(scope="module")
def client():
    with on_this_machine(2) as client:
        yield client


def squares(folder, deadly=()):
    """Squares numbers; whoever is first given 7 dies, and everyone who is given one of the `deadly`.

    Made here, so that a worker gets the function as it is and imports nothing for it."""

    def squared(numbers):
        import os
        import signal

        for number in numbers:
            first = folder / f"{number}"
            if number in deadly or number == 7 and not first.exists():
                first.touch()
                os.kill(os.getpid(), signal.SIGKILL)
        return [number**2 for number in numbers]

    return squared


PARTS = {f"part {k}": list(range(5 * k, 5 * k + 5)) for k in range(4)}


def test_nothing_is_lost_or_doubled_when_a_worker_dies(client, tmp_path):
    seen = list(worked_off(client, squares(tmp_path), PARTS))
    assert (tmp_path / "7").exists() and len(seen) == len(PARTS)
    assert dict(seen) == {name: [number**2 for number in numbers] for name, numbers in PARTS.items()}


@pytest.mark.slow
def test_only_what_kills_every_worker_is_lost(client, tmp_path):
    found = dict(worked_off(client, squares(tmp_path, [13]), PARTS))
    for name, numbers in PARTS.items():
        for number, result in zip(numbers, found[name], strict=True):
            if number == 13:
                assert isinstance(result, Lost) and "died" in result.why
            else:
                assert result == number**2


def test_what_the_work_raises_is_raised(client):
    def failing(numbers):
        raise ValueError("a mistake in the program")

    with pytest.raises(ValueError, match="a mistake in the program"):
        list(worked_off(client, failing, {"a": [1]}))


def test_without_dask_the_remedy_is_said(monkeypatch):
    imported = builtins.__import__

    def without(name, *rest, **named):
        if name == "distributed":
            raise ImportError(name)
        return imported(name, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match=r"pip install jaxid-robots\[fleet\]"), on_this_machine(1):
        pass
