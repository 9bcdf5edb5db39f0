"""jaxid/logs/signals.py."""

import numpy as np
import pytest

from jaxid.logs import signals


@pytest.mark.parametrize("order", range(2, 17))
def test_prbs_has_maximum_length_balance_and_two_valued_autocorrelation(order):
    length = 2**order - 1
    sequence = signals.prbs(order, 1.0, hold=0.02, sampling_interval=0.02, periods=1)
    assert len(sequence) == length and set(np.unique(sequence)) == {-1.0, 1.0}
    assert sequence.sum() == 1  # one chip more of +1
    spectrum = np.fft.fft(sequence)
    correlation = np.rint(np.fft.ifft(np.abs(spectrum) ** 2).real)
    assert correlation[0] == length and np.all(correlation[1:] == -1)  # so no shorter period either


def test_prbs_holds_repeats_and_shifts():
    once = signals.prbs(5, 3.0, hold=0.1, sampling_interval=0.02)
    assert len(once) == 31 * 5 and np.all(once.reshape(31, 5) == once[::5, None])
    np.testing.assert_array_equal(signals.prbs(5, 3.0, 0.1, 0.02, periods=2), np.tile(once, 2))
    other = signals.prbs(5, 3.0, 0.1, 0.02, seed=9)
    assert any(np.array_equal(np.roll(once[::5], shift), other[::5]) for shift in range(31))


@pytest.mark.parametrize(("order", "seed", "periods"), [(1, 1, 1), (17, 1, 1), (5, 32, 1), (5, 0, 1), (5, 1, 0)])
def test_prbs_refuses_what_it_cannot_make(order, seed, periods):
    with pytest.raises(ValueError, match="use"):
        signals.prbs(order, 1.0, hold=0.1, sampling_interval=0.02, periods=periods, seed=seed)


def test_steps_change_at_their_times():
    one = signals.step(5.0, start=0.3, duration=1.0, sampling_interval=0.02)
    assert len(one) == 50 and np.all(one[:15] == 0) and np.all(one[15:] == 5)
    both = signals.step_forward_and_back(5.0, 0.1, 0.2, 0.2, 0.1, 0.02)
    np.testing.assert_array_equal(np.unique(both, return_counts=True)[1], [10, 10, 10])
    assert both.sum() == 0 and len(signals.step_forward_and_back(5.0, 0, 0.2, 0.2, 0, 0.02)) == 20
    with pytest.raises(ValueError, match="positive"):
        signals.step(5.0, 0.0, 1.0, 0.0)


def test_multilevel_uses_all_levels_equally_and_none_twice_in_a_row():
    sequence = signals.multilevel([-6, -2, 2, 6], hold=0.1, duration=40, sampling_interval=0.02, seed=4)
    chips = sequence.reshape(-1, 5)
    assert len(sequence) == 2000 and np.all(chips == chips[:, :1]) and np.all(np.diff(chips[:, 0]) != 0)
    assert np.ptp(np.unique(chips[:, 0], return_counts=True)[1]) <= 1
    with pytest.raises(ValueError, match="two or more"):
        signals.multilevel([1, 1], 0.1, 1, 0.02, seed=0)


def test_multisine_has_the_chosen_lines_a_low_crest_and_its_peak():
    frequencies = np.arange(1, 21) / 10.0
    signal = signals.multisine(6.0, frequencies, duration=10, sampling_interval=0.01)
    amplitude = 2 * np.abs(np.fft.rfft(signal)) / len(signal)
    lines = np.arange(1, 21)
    np.testing.assert_allclose(amplitude[lines], amplitude[1], rtol=1e-9)
    assert np.max(np.delete(amplitude, lines)) < 1e-9 * amplitude[1]
    assert np.isclose(np.max(np.abs(signal)), 6.0)
    # Schroeder's phases: crest factor near 1.7 where equal phases have sqrt(2 * 20) = 6.3.
    assert np.max(np.abs(signal)) / np.std(signal) < 2.0
    with pytest.raises(ValueError, match="between 0 and 50"):
        signals.multisine(1.0, [60.0], 1.0, 0.01)


def test_chirp_sweeps_from_first_to_last_frequency():
    signal = signals.chirp(2.0, first=0.5, last=5.0, duration=10, sampling_interval=0.001)
    assert signal[0] == 0 and np.isclose(np.max(np.abs(signal)), 2.0, rtol=1e-4)
    up = np.flatnonzero((signal[:-1] < 0) & (signal[1:] >= 0)) * 0.001
    middle = (up[1:] + up[:-1]) / 2
    np.testing.assert_allclose(1 / np.diff(up), 0.5 + 0.45 * middle, rtol=0.02)  # linear sweep


def test_differential_drive_combines_modes_and_respects_the_limit():
    volts = signals.differential_drive([6.0, 6.0], [1.0, -2.0], limit=8.0)
    np.testing.assert_array_equal(volts, [[7, 5], [4, 8]])
    with pytest.raises(ValueError, match="8 V, above 7 V"):
        signals.differential_drive([6.0, 6.0], [1.0, -2.0], limit=7.0)
    with pytest.raises(ValueError, match="shapes"):
        signals.differential_drive([6.0], [1.0, 2.0])
