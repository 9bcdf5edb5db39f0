"""What a candidate would explain of a difference, to first order: as much as white noise lets it where there is none."""

import numpy as np

from jaxid.explanation.changes.whitened import statistic


def test_coordinates_that_do_nearly_the_same_explain_no_more_than_chance():
    """As points of a curve that little was driven between: each scatters in its own way, and their difference is small."""
    blocks, logs = np.arange(4000) // 40, np.arange(4000) // 1000
    found = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        first = rng.normal(size=4000)
        D = np.stack([first, first + 0.01 * rng.normal(size=4000), rng.normal(size=4000)], axis=1) * (1.0, 300.0, 1e-3)
        left = rng.normal(size=4000)
        drop, freedom = statistic(D, left, left, blocks, logs, 5)
        basis = np.linalg.qr(D)[0]
        assert freedom == 3 and drop <= np.sum((basis.T @ left) ** 2) * (1.0 + 1e-9)
        found.append(drop)
    assert 2.0 < np.mean(found) < 3.3  # three on average, less what blocks of time widen


def test_coordinates_that_do_the_same_count_once():
    rng = np.random.default_rng(1)
    one, left = rng.normal(size=400), rng.normal(size=400)
    blocks, logs = np.arange(400) // 10, np.zeros(400, int)
    alone = statistic(one[:, None], left, left, blocks, logs, 2)
    both = statistic(np.stack([one, -3.0 * one], axis=1), left, left, blocks, logs, 2)
    assert both[1] == alone[1] == 1
    np.testing.assert_allclose(both[0], alone[0], rtol=1e-9)
