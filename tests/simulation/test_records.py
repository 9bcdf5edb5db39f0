"""Effects on whole records, in NumPy and in XLA."""

import numpy as np

import jaxid
from jaxid._float64 import float64
from jaxid.simulation import records


def test_what_computes_much_on_one_shape_is_compiled_and_stays_the_same():
    robot = (jaxid.Axis() + jaxid.effects.effect_by_id(jaxid.Axis(), "input_delay")).structure
    own = records.records_of(robot, ("input_delay.delay",))
    rng, dt = np.random.default_rng(0), np.full((1000, 40), 0.01)
    inputs = rng.normal(size=(1000, 40, 1))
    with float64():
        first = records.commanded(own, [0.03], inputs, dt, 2)
        for _ in range(records._SELDOM // first.size + 2):
            last = records.commanded(own, [0.03], inputs, dt, 2)
    program = records._in_xla[records._command]
    assert program._outer._cache_size() >= 1
    np.testing.assert_allclose(last, first, rtol=0, atol=1e-13)
    np.testing.assert_allclose(
        last[:, 3:, :, 0], np.repeat(inputs[:, :-3], 2, axis=2), atol=1e-12
    )  # three samples later
