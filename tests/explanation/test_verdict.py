"""jaxid/explanation/verdict.py: what is said of a model beside its name."""

from jaxid.explanation.verdict import doubted_on


def test_of_a_model_that_leaves_nothing_but_noise_nothing_is_said_to_be_missing(explained):
    """Though it be more than on the fitted logs; of one that leaves more, it is."""
    final, after = explained.final, explained.after
    assert after.adequate and doubted_on(final, after) is final
    assert not explained.before.adequate
    said = doubted_on(final, explained.before)
    assert "something is missing" in said.judgement.sentence and not said.trustworthy
