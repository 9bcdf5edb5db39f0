"""Of two edges that a first look places, neither begins next to zero, from where no search comes back."""

from types import SimpleNamespace

from jaxid import Axis
from jaxid.effects import effect_by_id
from jaxid.explanation.screening.screen import _with_all_edges


def tried(law, *starts):
    robot = Axis()
    effect = effect_by_id(robot, "actuator_dead_zone", law).blurred
    strengths = dict.fromkeys(effect.parameters(robot), 1.0)
    group = SimpleNamespace(
        effect=effect, robot=robot + effect, probe=SimpleNamespace(strengths=strengths), plain=lambda values: values
    )
    return [SimpleNamespace(group=group, start=dict(zip(strengths, own, strict=True))) for own in starts]


def test_an_edge_next_to_zero_is_no_beginning():
    found = tried("unequal_thresholds", (0.8, 0.02), (0.9, 0.7), (0.8, 0.0))
    assert [list(own.start.values()) for own in _with_all_edges(found)] == [[0.9, 0.7]]
    only = tried("unequal_thresholds", (0.8, 0.0))
    assert _with_all_edges(only) == only


def test_what_has_no_edge_begins_anywhere():
    found = tried("unequal_edges", (0.8, 0.0), (0.9, 0.7))
    assert _with_all_edges(found) == found
