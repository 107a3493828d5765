"""Dwells of a stepped sine give amplitude and phase, with uncertainties that hold."""

import numpy as np
import pytest
import rig
from lab_records import RATE_HZ, X_ONLY, draw_sensor, noisy, pair_of, relative_error

from frac_accel import FracAccelError
from frac_accel.identification import response_points


def record_of(rng, count=20, duration_s=12.0, **effects):
    drawn = draw_sensor(rng)
    sensor = rig.Sensor(drawn.core, {**drawn.effects, **effects})
    frequencies = np.geomspace(rng.uniform(15, 25), rng.uniform(400, 600), count)
    return sensor, rig.simulate_record(
        sensor, rig.stepped_sine(RATE_HZ, duration_s, frequencies, X_ONLY))


@pytest.fixture(scope="module")
def records():
    rng = np.random.default_rng(20500)
    return [record_of(rng) for _ in range(3)]


def test_amplitude_and_phase_at_60_db(records):
    rng = np.random.default_rng(20501)
    for sensor, record in records:
        points = response_points(pair_of(record, noisy(record, rng, 60)))
        assert len(points) == 20
        ratio = 1 + relative_error(points, sensor)
        assert np.max(np.abs(np.abs(ratio) - 1)) < 1e-3
        assert np.max(np.abs(np.degrees(np.angle(ratio)))) < 0.1


@pytest.mark.parametrize("pole", [0.0, 0.9], ids=["white", "coloured"])
def test_intervals_cover_the_truth(records, pole):
    rng = np.random.default_rng(20502)
    scores = []
    for sensor, record in records:
        for _ in range(8):
            points = response_points(pair_of(record, noisy(record, rng, rng.uniform(20, 60), pole)))
            error = relative_error(points, sensor)
            scores += [error.real / points.std_amplitude, error.imag / points.std_phase_rad]
    scores = np.concatenate(scores)
    # 960 independent trials of 0.95: below 0.928 and above 0.968 have a probability of 0.2 %
    assert 0.928 < np.mean(np.abs(scores) < 1.96) < 0.968
    assert np.sqrt(np.mean(scores**2)) < 1.1


def test_without_noise_only_the_ramps_are_left_out(records):
    for sensor, record in records:
        points = response_points(pair_of(record, record.clean))
        assert np.max(np.abs(relative_error(points, sensor))) < 1e-4
        lengths = [part["stop_s"] - part["start_s"] for part in points.segments]
        # of 0.6 s, a fifth at either end is a ramp
        assert 0.25 < min(lengths) and max(lengths) < 0.6


def test_missing_samples_and_lag_of_the_stamps(records):
    rng = np.random.default_rng(20503)
    for sensor, record in records:
        keep = rng.random(len(record.sensor)) > 0.05
        late = int(0.3e9 / RATE_HZ)
        points = response_points(pair_of(record, noisy(record, rng, 60), keep, late))
        points.response[:] *= np.exp(2j * np.pi * points.frequency_hz * late * 1e-9)
        assert len(points) == 20
        assert np.max(np.abs(relative_error(points, sensor))) < 1e-3


def test_harmonics_of_a_cubic_stiffness():
    rng = np.random.default_rng(20504)
    sensor, record = record_of(rng, count=6, duration_s=4.0)
    size = np.sqrt(np.mean(record.clean[:, 0]**2))
    clean = response_points(pair_of(record, noisy(record, rng, 60)))
    cubic = {"cubic_stiffness": {"alpha3": 0.05 / size**2}}
    bent = rig.Sensor(sensor.core, {**sensor.effects, **cubic})
    excitation = rig.stepped_sine(RATE_HZ, 4.0, clean.frequency_hz, X_ONLY)
    record = rig.simulate_record(bent, excitation, rng, snr_db=60)
    found = response_points(pair_of(record)).distortion
    assert found["harmonics"] > 5 * clean.distortion["harmonics"]
    assert found["reference_harmonics"] < 1e-3
    assert "harmonics of at most" in found["words"]


def test_dwells_too_short_are_told():
    rng = np.random.default_rng(20505)
    sensor = draw_sensor(rng)
    excitation = rig.stepped_sine(RATE_HZ, 3.0, [10.0, 100.0, 200.0, 300.0, 400.0, 500.0], X_ONLY)
    points = response_points(pair_of(rig.simulate_record(sensor, excitation, rng)))
    assert len(points) == 5
    assert points.notes == ["1 of 6 dwells have too short a steady part for a sine fit"]


def test_a_record_full_of_holes_is_refused():
    rng = np.random.default_rng(20506)
    excitation = rig.band_noise(rng, RATE_HZ, 2.0, (5.0, 600.0), X_ONLY)
    record = rig.simulate_record(draw_sensor(rng), excitation, rng)
    keep = rng.random(len(record.sensor)) > 0.1
    with pytest.raises(FracAccelError, match="longest run without a missing sample"):
        response_points(pair_of(record, keep=keep))
