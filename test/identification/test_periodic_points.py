"""Periods of a multisine give the response with its variance, and the nonlinear distortion."""

import numpy as np
import pytest
import rig
from lab_records import RATE_HZ, X_ONLY, draw_sensor, noisy, pair_of, relative_error

from frac_accel.identification import response_points


def multisine_record(rng, lead_s=1.0, **effects):
    drawn = draw_sensor(rng)
    sensor = rig.Sensor(drawn.core, {**drawn.effects, **effects})
    excitation = rig.multisine(rng, RATE_HZ, 4.0, (5.0, 600.0), 0.5, X_ONLY, lead_s=lead_s)
    return sensor, rig.simulate_record(sensor, excitation)


@pytest.mark.parametrize("pole", [0.0, 0.9], ids=["white", "coloured"])
def test_intervals_cover_the_truth(pole):
    rng = np.random.default_rng(20600)
    scores = []
    for _ in range(4):
        sensor, record = multisine_record(rng)
        for _ in range(3):
            points = response_points(pair_of(record, noisy(record, rng, rng.uniform(20, 60), pole)))
            assert points.excitation.kind == "multisine"
            error = relative_error(points, sensor)
            scores += [error.real / points.std_amplitude, error.imag / points.std_phase_rad]
    # 7152 trials that share their variances with neighbours
    assert 0.935 < np.mean(np.abs(np.concatenate(scores)) < 1.96) < 0.965


def test_noise_on_the_reference_is_in_the_uncertainty():
    rng = np.random.default_rng(20601)
    scores = []
    for _ in range(4):
        sensor, record = multisine_record(rng)
        record.reference[:, 0] += 0.01 * rng.normal(size=len(record.reference))
        points = response_points(pair_of(record, noisy(record, rng, 60)))
        error = relative_error(points, sensor)
        scores += [error.real / points.std_amplitude, error.imag / points.std_phase_rad]
    assert 0.93 < np.mean(np.abs(np.concatenate(scores)) < 1.96) < 0.97


def test_periods_of_the_transient_and_with_holes_are_left_out():
    rng = np.random.default_rng(20602)
    sensor, record = multisine_record(rng, lead_s=0.0)
    keep = np.ones(len(record.sensor), bool)
    keep[5200:5210] = False  # in the sixth of eight periods of 1000 samples
    points = response_points(pair_of(record, noisy(record, rng, 60), keep))
    assert points.segments[0]["periods"] == 6
    assert points.notes == ["1 of the multisine's periods left out: transient",
                            "1 of the multisine's periods left out: samples missing"]
    error = relative_error(points, sensor)
    assert np.sqrt(np.mean(np.abs(error / points.std_amplitude)**2) / 2) < 1.1


@pytest.mark.parametrize("seed", range(4))
def test_cubic_stiffness_is_found_at_the_lines_not_excited(seed):
    rng = np.random.default_rng(20610 + seed)
    sensor, record = multisine_record(rng)
    straight = response_points(pair_of(record, noisy(record, rng, 60))).distortion
    assert not straight["found"]
    assert "no nonlinear distortion" in straight["words"]
    size = np.mean(record.clean[:, 0]**2)
    excitation = rig.multisine(rng, RATE_HZ, 4.0, (5.0, 300.0), 0.5, X_ONLY, lead_s=1.0)
    levels = []
    for share in (0.003, 0.03):
        bent = rig.Sensor(sensor.core,
                          {**sensor.effects, "cubic_stiffness": {"alpha3": share / size}})
        record = rig.simulate_record(bent, excitation, rng, snr_db=60)
        found = response_points(pair_of(record)).distortion
        assert found["found"] and found["above_noise_db"] > 6
        levels.append(found["level_db"])
    # ten times the coefficient: 20 dB, less what the stiffness takes from the amplitude
    assert 15 < levels[1] - levels[0] < 22


@pytest.mark.parametrize("cause, name, odd", [("cubic_stiffness", "alpha3", True),
                                              ("quadratic_stiffness", "alpha2", False)])
def test_odd_lines_tell_odd_from_even(cause, name, odd):
    rng = np.random.default_rng(20620)
    lines = [k for k in range(5, 300, 2) if k % 8 != 1]
    for _ in range(2):
        drawn = draw_sensor(rng)
        excitation = rig.sines(RATE_HZ, 5.0, lines, 2 * np.pi * rng.random(len(lines)),
                               np.sqrt(2 / len(lines)) * np.array(X_ONLY), lead_s=1.0)
        level = rig.simulate_record(drawn, excitation).clean[:, 0].std()
        strength = 0.003 / (level**2 if odd else level)
        sensor = rig.Sensor(drawn.core, {**drawn.effects, cause: {name: strength}})
        found = response_points(pair_of(rig.simulate_record(sensor, excitation, rng))).distortion
        assert found["found"]
        here, other = ("odd", "even") if odd else ("even", "odd")
        assert np.isfinite(found[f"{here}_db"])
        # what is left on the others is of the next order
        assert not found[f"{other}_db"] > found[f"{here}_db"] - 15
