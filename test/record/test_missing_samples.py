"""What is missing of a record leaves the samples beside it as they are."""

import numpy as np
import pytest
from scipy.fft import irfft, rfft, rfftfreq
from scipy.signal import butter, sosfilt

from frac_accel import Samples
from frac_accel.record import Record

RATE, COUNT, FINE = 500.0, 4000, 16


def samples(values, rate, kept=slice(None)):
    stamps = np.round(1e9 * np.arange(len(values)) / rate)[kept]
    return Samples.of(stamps, np.outer(values[kept], [1, 0, 0]))


@pytest.mark.parametrize("seed", range(4))
def test_what_is_beyond_the_common_band_rings_beside_no_gap(seed):
    """The guess of a sample was changed so that little of the signal was beyond the band, though
    much is: several per cent of it rang on beside each gap."""
    rng = np.random.default_rng([88, seed])
    lines = rfft(rng.normal(size=FINE * COUNT))
    lines[rfftfreq(FINE * COUNT, 1 / (FINE * RATE)) > rng.uniform(210, 240)] = 0
    motion = irfft(lines)
    lag = sosfilt(butter(1, rng.uniform(300, 900), fs=FINE * RATE, output="sos"), motion)
    sensor = lag[::FINE]
    noise = 1e-3 * sensor.std()
    sensor = sensor + noise * rng.normal(size=COUNT)
    gone = np.arange(200, COUNT - 200, 300) + rng.integers(100)
    records = [Record.of(samples(motion[::4], 4 * RATE), samples(sensor, RATE, kept))
               for kept in (slice(None), np.delete(np.arange(COUNT), gone))]
    whole, gappy = (record.comparable(0, record.valid) for record in records)
    changed = (gappy.sensor - whole.sensor)[gappy.valid & whole.valid, 0]
    assert np.abs(changed).max() < 3 * noise
