"""Which refits of a change are told apart, beside models that are good and beside poor ones."""

from types import SimpleNamespace

import numpy as np

from jaxid.explanation.changes.trials import simplest_first


def trial(name, squares, count, seed):
    residual = np.random.default_rng(seed).normal(size=(2000, 1))
    residual *= np.sqrt(squares / np.sum(residual**2))
    joint = SimpleNamespace(squares=squares, delta=np.zeros(count))
    return SimpleNamespace(name=name, joint=joint, total=squares, compared=[residual])


def test_beside_poor_models_what_explains_nearly_as_much_is_as_good():
    """Chi-squared of 900 to 2000 explained: 40 more of it decide between good models, and say nothing of poor ones."""
    null = SimpleNamespace(squares=2000.0)
    trials = [trial("curve", 900.0, 4, 1), trial("gain", 940.0, 1, 2), trial("mass", 1200.0, 1, 3)]
    assert [t.name for t in simplest_first(trials, null, False)] == ["curve"]
    assert [t.name for t in simplest_first(trials, null, True)] == ["gain", "curve"]
