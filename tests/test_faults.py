"""The deliberate faults of `benchmarks.mutation` can be put into the code as it stands."""

import pytest

from benchmarks.faults import FAULTS
from benchmarks.mutation import ROOT, matches


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.what)
def test_a_fault_has_its_place_and_its_tests(fault):
    assert matches(fault) == 1, f"its text stands {matches(fault)} times in {fault.file}; write the fault anew"
    assert fault.old != fault.new and (ROOT / fault.tests.split()[0]).exists()
