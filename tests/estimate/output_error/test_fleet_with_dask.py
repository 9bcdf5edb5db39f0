"""jaxid/estimate/output_error/fleet_with_dask.py: the fits of a fleet in one process, though a worker dies on the way."""

import os
import signal

import numpy as np
import pytest

from jaxid import Axis, LogSet, fit_fleet, fit_fleet_with_dask
from jaxid._dask import on_this_machine
from jaxid.estimate.output_error import fleet_with_dask

pytest.importorskip("distributed")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # those of the libraries' own event loops
def test_a_fleet_on_two_processes_of_which_one_dies_has_the_fits_of_one(axis_log, monkeypatch):
    robot = Axis().change("offset", free=False).with_values(M=1.0, Fv=2.0, Fc=0.5)
    inputs = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5], 40)
    fleet = {
        f"{k}": LogSet([axis_log("run", np.roll(inputs, 40 * k), 0.01, k, position=False, M=1 + 0.1 * k)])
        for k in range(6)
    }
    monkeypatch.setattr(fleet_with_dask, "PART", 1)
    said = []
    with on_this_machine(2) as client:
        worker = next(iter(client.run(os.getpid).values()))

        def report(message):
            if not said:
                os.kill(worker, signal.SIGKILL)  # the rest is left to the other, and to what takes its place
            said.append(message)

        found = fit_fleet_with_dask(robot, fleet, client, report=report)
    alone = fit_fleet(robot, fleet)
    assert len(said) == len(fleet) and said[-1] == "6 of 6 members done"
    assert list(found.fits) == list(alone.fits) and not found.failed
    for member, fit in alone.fits.items():
        for name in fit.free_names:
            assert found.fits[member][name] == fit[name]
