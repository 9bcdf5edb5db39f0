"""jaxid/explanation/verdict.py: what is said of a model beside its name."""

from dataclasses import replace

from jaxid.explanation.left.coloured import OnlyColour
from jaxid.explanation.left.noisy_inputs import InputNoise
from jaxid.explanation.verdict import doubted_on


def test_of_a_model_that_leaves_nothing_but_noise_nothing_is_said_to_be_missing(explained):
    """Though it be more than on the fitted logs; of one that leaves more, it is."""
    final, after = explained.final, explained.after
    assert after.adequate and doubted_on(final, after) is final
    columns = doubted_on(final, after, ("columns of the logs contradict the model",))
    assert "no answer, since columns of the logs contradict" in columns.judgement.sentence and not columns.trustworthy
    assert not explained.before.adequate
    said = doubted_on(final, explained.before)
    assert "something is missing" in said.judgement.sentence and not said.trustworthy


def test_what_a_law_that_is_near_natures_leaves_is_not_said_to_be_the_inputs_noise_for_certain(explained):
    """Of a hundred and seventy times the noise three were left, which the inputs' noise could make, too."""
    inputs = InputNoise((0.0, 0.0035, 0.0), 0.5)
    colour = OnlyColour({}, True, False, of_inputs=inputs)
    far, left = replace(explained.before, normalised_rms=173.0), replace(explained.after, normalised_rms=3.3)
    said = replace(explained, colour=colour, before=far, after=left).sentence
    assert "what noise of the inputs makes" in said and "or what is wrong with the form of the law" in said
    said = replace(explained, colour=colour, before=replace(far, normalised_rms=5.0), after=left).sentence
    assert "what noise of the inputs makes" in said and "form of the law" not in said


def test_a_gap_that_hardly_falls_is_not_said_to_fall(explained):
    little = replace(explained.before, normalised_rms=explained.after.normalised_rms + 1e-4)
    assert "hardly falls by it" in replace(explained, before=little).sentence
    assert "hardly falls" not in explained.sentence
