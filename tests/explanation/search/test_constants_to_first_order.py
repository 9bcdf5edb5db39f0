"""jaxid/explanation/search/constants_to_first_order.py: which wrong constants of the table may do what is wanted."""

import numpy as np

from jaxid.explanation.search.constants_to_first_order import likely


def test_two_constants_are_found_where_a_third_alone_does_more_than_either():
    """Chosen one by one, what is nearly the sum of two comes first, and with any one of these the answer is worse."""
    rng = np.random.default_rng(5)
    own, one, other, far = np.linalg.qr(rng.normal(size=(500, 4)))[0].T
    columns = {
        "a": 3.0 * one + 2.0 * own,
        "b": 0.1 * other - own,
        "between": one + other + 0.4 * far,
        "nothing": 5.0 * own,
    }
    sets, twins = likely(own[None], columns, one + other + 0.7 * own)
    assert ("between",) in sets and ("a", "b") in sets
    assert not any("nothing" in chosen for chosen in sets)  # the fitted parameters do all that it does
    assert twins["a"] == ("a",)


def test_constants_that_do_the_same_are_known_for_it():
    """A mass and a resistance that scale one force: which of them it is, no log says."""
    rng = np.random.default_rng(6)
    own, one, other = np.linalg.qr(rng.normal(size=(500, 3)))[0].T
    columns = {"mass": one + 3.0 * own, "resistance": -2.0 * one + own, "length": other}
    sets, twins = likely(own[None], columns, one)
    assert set(twins["mass"]) == {"mass", "resistance"} and twins["length"] == ("length",)
    assert sets[:2] == [("mass",), ("resistance",)] or sets[:2] == [("resistance",), ("mass",)]


def test_stretches_where_a_change_is_out_of_all_proportion_hide_no_constant():
    """A caster that flips a little earlier moves one stretch of a log by more than all else; no slope says that."""
    rng = np.random.default_rng(8)
    own, one, other = np.linalg.qr(rng.normal(size=(1000, 3)))[0].T
    flip, another = np.zeros(1000), np.zeros(1000)
    flip[500:520], another[510:530] = 5.0, 7.0
    columns = {"radius": one + flip, "length": other - flip + another, "mass": own}
    wanted = one + 0.5 * other
    sets, _ = likely(own[None], columns, wanted)
    assert ("radius", "length") in sets
    flipped = {name: column if name == "mass" else column * (np.abs(column) < 1) for name, column in columns.items()}
    assert sets == likely(own[None], flipped, wanted)[0]
