"""Which refits of a change are told apart, beside models that are good and beside poor ones."""

from types import SimpleNamespace

import numpy as np

from jaxid.explanation.changes.candidates import Candidate, Coordinate, both
from jaxid.explanation.changes.trials import each_once, simplest_first


def trial(name, squares, count, seed, usual=False, as_well_as="", of=()):
    residual = np.random.default_rng(seed).normal(size=(2000, 1))
    residual *= np.sqrt(squares / np.sum(residual**2))
    joint = SimpleNamespace(squares=squares, delta=np.zeros(count))
    coordinates = tuple(Coordinate(own, "", 1.0, own) for own in of)
    score = SimpleNamespace(candidate=Candidate(name, name, coordinates, None, usual=usual, as_well_as=as_well_as))
    return SimpleNamespace(name=name, joint=joint, total=squares, compared=[residual], score=score)


def test_beside_poor_models_what_explains_nearly_as_much_is_as_good():
    """Chi-squared of 900 to 2000 explained: 40 more of it decide between good models, and say nothing of poor ones."""
    null = SimpleNamespace(squares=2000.0)
    trials = [trial("curve", 900.0, 4, 1), trial("gain", 940.0, 1, 2), trial("mass", 1200.0, 1, 3)]
    assert [t.name for t in simplest_first(trials, null, False)] == ["curve"]
    assert [t.name for t in simplest_first(trials, null, True)] == ["gain", "curve"]


def test_of_equally_simple_ones_the_usual_comes_first():
    """A motor and a floor, or a load and a battery, that make the same motion but for what each takes up of the noise."""
    trials = [trial("gain and friction", 900.0, 3, 1), trial("load and battery", 902.0, 3, 1, usual=True)]
    trials.append(trial("another", 903.0, 2, 1))
    null = SimpleNamespace(squares=2000.0)
    assert [t.name for t in simplest_first(trials, null, False)] == ["another"]
    assert [t.name for t in simplest_first(trials[:2], null, False)] == ["load and battery", "gain and friction"]


def test_a_load_stands_beside_what_may_be_taken_for_some_loads():
    """Smaller wheels by whose turns the speeds are measured are a mass and an inertia smaller in one proportion."""
    null = SimpleNamespace(squares=2000.0)
    wheels, load = trial("wheels", 900.0, 1, 1, as_well_as="load"), trial("load", 899.0, 2, 1, usual=True)
    more = trial("load off centre", 898.5, 4, 1)
    assert [t.name for t in simplest_first([wheels, load, more], null, False)] == ["wheels", "load"]


def test_a_load_stands_beside_what_is_no_usual_change_and_happens_to_do_the_same():
    """A load of the very proportion that heavier wheels make; but one number of a load is no more by both of its numbers."""
    null = SimpleNamespace(squares=2000.0)
    load = trial("load", 899.0, 2, 1, usual=True, of=("M", "J"))
    wheels, mass = trial("wheels", 900.0, 1, 1, of=("Iw",)), trial("mass", 900.0, 1, 1, of=("M",))
    other = trial("where it lies", 898.5, 2, 1, of=("xc", "yc"))
    assert [t.name for t in simplest_first([wheels, load, other], null, False)] == ["wheels", "load"]
    assert [t.name for t in simplest_first([mass, load], null, False)] == ["mass"]


def test_what_stands_for_another_does_so_beside_a_third_and_within_bounds():
    def one(name, **options):
        return Candidate(name, name, (Coordinate(name, "", 1.0),), lambda numbers, d: {}, **options)

    wheels, load, battery = one("wheels", as_well_as="load", most=0.06), one("load"), one("battery")
    assert wheels.stands_for == load.ids and not load.stands_for
    assert both(battery, wheels).stands_for == both(load, battery).ids and not both(load, battery).stands_for
    assert both(battery, wheels).believable(np.array([0.3, -0.05]))
    assert not both(battery, wheels).believable(np.array([0.3, -0.07])) and load.believable(np.array([5.0]))


def test_what_was_tried_on_several_grounds_counts_once_at_its_best():
    def of(total, *parts):
        return SimpleNamespace(total=total, score=SimpleNamespace(candidate=SimpleNamespace(parts=parts)))

    first, again, other = of(930.0, "gain", "load"), of(910.0, "load", "gain"), of(920.0, "gain", "floor")
    assert each_once([first, other, again]) == [again, other]
    assert each_once([again, other, first]) == [again, other]
