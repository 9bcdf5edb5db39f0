"""jaxid/explanation/next_experiment.py: proposals that would tell two models apart, and none that would not."""

import numpy as np
import pytest

from jaxid import Axis
from jaxid.explanation.next_experiment import propose
from tests.explanation.closed_form_axis import NOISE, driven

AXIS = Axis().with_values(M=1.0, Fv=2.0, Fc=0.0)


@pytest.mark.parametrize(("more", "told"), [(1e-4, False), (0.05, True)])
def test_an_experiment_is_proposed_where_it_would_tell(more, told):
    """Viscous friction larger by a share of itself: of the noise 0.00 times in a whole log, or several times."""
    logs, _ = driven(lambda u: u, 3)
    other = AXIS.with_values(Fv=2.0 * (1.0 + more))
    found = propose(("one", AXIS), ("other", other), logs, {"v": NOISE}, so_far=0.0)
    assert (found is not None) == told
    if found is not None:
        assert found.separation > 0.2 and np.max(np.abs(found.inputs)) <= 4.0
