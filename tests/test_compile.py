"""What jaxid does to the process around its programs, and that it is undone."""

import gc

import pytest

from jaxid._compile import seldom_collected


@pytest.fixture
def thresholds():
    """Whatever a test sets, put back."""
    before = gc.get_threshold()
    yield
    gc.set_threshold(*before)


@pytest.mark.parametrize(
    ("own", "inside"),
    [((700, 10, 10), 50_000), ((90_000, 5, 5), 90_000), ((0, 10, 10), 0)],
    ids=["usual", "rare", "off"],
)
def test_garbage_is_looked_for_less_often_and_then_as_before(thresholds, own, inside):
    gc.set_threshold(*own)

    @seldom_collected()
    def failing():
        assert gc.get_threshold() == (inside, *own[1:])
        raise ValueError

    for _ in range(2):
        with pytest.raises(ValueError):
            failing()
        assert gc.get_threshold() == own
