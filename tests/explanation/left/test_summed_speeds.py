"""Complete models, and one that lacks drag, in closed loops on the differences of an encoder's counts."""

from jaxid import Axis, LogSet, explain, output_error
from jaxid.explanation.left.summed_speeds import on_summed_speeds
from tests.counted_loop import axis_in_a_loop


def _logs(first, count, **changes):
    return LogSet([axis_in_a_loop(f"run{k}", Axis(), k, 1e-3, 12.0, **changes) for k in range(first, first + count)])


def test_a_complete_model_in_a_loop_lacks_nothing():
    fit = output_error(Axis(), logs := _logs(0, 2))
    found = explain(fit, logs, _logs(10, 1))
    assert found.verdict == "adequate" and any("an encoder's count" in note for note in found.notes)
    assert abs(found.final.parameters["M"].value - 2.0) < 4.0 * found.final.parameters["M"].std_error
    assert found.held_out[0].measured == ("q",)


def test_in_an_open_loop_the_speeds_stay():
    logs, held_out = _logs(0, 2, looped=False), _logs(10, 1, looped=False)
    fit = output_error(Axis(), logs)
    assert on_summed_speeds(fit, logs, held_out, lambda _: None) == (fit, logs, held_out, "")


def test_what_a_model_lacks_is_looked_for_in_the_speeds():
    """A force that it lacks takes it further from the counts than one of them."""
    lacks = {"own": lambda v: 12.0 * v * abs(v)}
    logs, held_out = _logs(0, 2, **lacks), _logs(10, 1, **lacks)
    fit = output_error(Axis(), logs)
    assert on_summed_speeds(fit, logs, held_out, lambda _: None) == (fit, logs, held_out, "")
