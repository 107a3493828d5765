"""Noise, sweeps and shocks give points whose uncertainties hold, without the bias of leakage."""

import numpy as np
import pytest
import rig
import scipy.signal
from lab_records import (
    EXCITATIONS,
    RATE_HZ,
    X_ONLY,
    draw_sensor,
    noisy,
    pair_of,
    relative_error,
)

from frac_accel.identification import response_points


@pytest.mark.parametrize("pole", [0.0, 0.9], ids=["white", "coloured"])
@pytest.mark.parametrize("kind", ["noise", "sweep", "shock"])
def test_intervals_cover_the_truth(kind, pole):
    rng = np.random.default_rng(20800)
    scores = []
    for _ in range(4):
        sensor = draw_sensor(rng)
        record = rig.simulate_record(sensor, EXCITATIONS[kind](rng))
        for _ in range(3):
            points = response_points(pair_of(record, noisy(record, rng, rng.uniform(20, 60), pole)))
            error = relative_error(points, sensor)
            scores += [error.real / points.std_amplitude, error.imag / points.std_phase_rad]
    # 1000 to 3000 trials that share their variances with neighbours
    assert 0.925 < np.mean(np.abs(np.concatenate(scores)) < 1.96) < 0.97


def test_leakage_of_a_sharp_resonance_is_no_bias():
    """Against the average of windowed segments, which takes a resonance to be broader."""
    rng = np.random.default_rng(20801)
    for _ in range(3):
        sensor = rig.draw_sensor(rng, RATE_HZ, "classical", natural_frequency=(0.1, 0.2),
                                 damping_ratio=(0.01, 0.02))
        excitation = rig.band_noise(rng, RATE_HZ, 8.0, (5.0, 700.0), X_ONLY, lead_s=1.0)
        record = rig.simulate_record(sensor, excitation, rng, snr_db=60)
        points = response_points(pair_of(record))
        natural = sensor.core["natural_frequency_hz"]
        near = np.abs(points.frequency_hz / natural - 1) < 0.1
        ours = np.abs(relative_error(points, sensor))[near]
        frequency, cross = scipy.signal.csd(record.reference[:, 0], record.sensor[:, 0], RATE_HZ,
                                            nperseg=2048)
        _, power = scipy.signal.welch(record.reference[:, 0], RATE_HZ, nperseg=2048)
        beside = np.abs(frequency / natural - 1) < 0.1
        exact = rig.transfer_function(sensor, "x", 2j * np.pi * frequency[beside])
        windowed = np.abs(cross[beside] / power[beside] / exact - 1)
        assert np.median(ours) < 0.2 * np.median(windowed)


def test_a_gap_leaves_the_longest_run():
    rng = np.random.default_rng(20802)
    sensor = draw_sensor(rng)
    record = rig.simulate_record(sensor, EXCITATIONS["noise"](rng), rng, snr_db=60)
    keep = np.ones(len(record.sensor), bool)
    keep[3000:3003] = False
    points = response_points(pair_of(record, keep=keep))
    assert points.segments == [{"start_s": 3003 / RATE_HZ, "stop_s": 4.0}]
    assert "longest run without a gap, 1.5" in points.notes[0]
    scores = np.abs(relative_error(points, sensor)) / points.std_amplitude
    assert np.sqrt(np.mean(scores**2) / 2) < 1.15
