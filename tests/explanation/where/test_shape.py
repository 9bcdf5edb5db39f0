"""A curve's points in words."""

import numpy as np

from jaxid.explanation.where.shape import Shape


def shape(values, half):
    band = tuple((v - h, v + h) for v, h in zip(values, half, strict=True))
    return Shape("w1", "|drive force|", "N", "N", (0.0, 10.0, 20.0, 30.0), values, band)


def test_a_height_that_the_data_does_not_tell_is_no_number():
    found = shape((0.0, 12.9, 36.7, -863.0), (0.0, 4.5, 19.0, 2400.0))
    assert found.known == (True, True, True, False)
    assert found.sentence == "w1: 0 N at 0 N, 12.9 N at 10 N, 36.7 N at 20 N, not told at 30 N"


def test_where_nothing_stands_out_all_of_it_is_said():
    found = shape((0.0, 0.1, -0.2, 0.1), (0.0, 0.3, 0.3, np.inf))
    assert found.known == (True,) * 4
