"""A change in words: of a mechanism with several laws the one that came, since what is more of one is less of another."""

import numpy as np

from jaxid import DifferentialDrive
from jaxid.effects import laws_of
from jaxid.estimate.result import Estimate
from jaxid.explanation.changes.candidates import both, candidates_of, of_mechanism
from jaxid.explanation.changes.change import Difference, apart_in_words
from jaxid.explanation.changes.named import _said


def differences(candidate):
    shares = np.linspace(0.1, 0.3, len(candidate.coordinates))
    return {
        c.name: Difference(0.0, float(x), Estimate.of(float(x), 0.01, c.unit, "identified"))
        for c, x in zip(candidate.coordinates, shares, strict=True)
    }


def test_the_law_and_its_formula_stand_beside_the_name():
    robot = DifferentialDrive()
    laws = laws_of(robot, "motor_gain_mismatch")
    assert len(laws) > 1
    for law in laws[:2]:
        candidate = of_mechanism(law, robot, "after")
        change = _said(candidate, differences(candidate), 1.0, ())
        assert law.law.replace("_", " ") in change.words and law.formula in change.words
        assert (change.to_dict()["law"], change.to_dict()["formula"]) == (law.law, law.formula)


def test_of_two_changes_each_has_its_own_law_and_a_parameter_has_none():
    robot = DifferentialDrive()
    law = laws_of(robot, "motor_gain_mismatch")[0]
    mass = next(candidate for candidate in candidates_of(robot) if candidate.own)
    candidate = both(mass, of_mechanism(law, robot, "after"))
    found = differences(candidate)
    parts = tuple(_said(part, found, 1.0, ()) for part in candidate.parts)
    change = _said(candidate, found, 1.0, (), parts)
    assert [part.law for part in change.parts] == ["", law.law] and change.law == ""
    assert change.words.count("by the law") == 1


def test_numbers_that_differ_are_not_printed_alike():
    assert apart_in_words(1.00042, 0.99961) == ("1", "0.9996")
    assert apart_in_words(1.00004, 1.00001) == ("1.00004", "1.00001")
    assert apart_in_words(3.217, 1.0) == ("3.22", "1") and apart_in_words(2.0, 2.0) == ("2", "2")
