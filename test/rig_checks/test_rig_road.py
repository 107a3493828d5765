"""The road's motion has the spectrum of ISO 8608 behind a quarter car, and its cases are sound."""

import json

import numpy as np
import pytest
import scipy.signal
import scipy.stats
from rig.road import ROUGHNESS, Drive, QuarterCar, draw_drive, drive_on_road, turned
from rig.road_cases import ROAD_CAUSES, ROAD_VARIANTS, draw_road_case
from rig.sensor import UNCATALOGUED
from scipy.integrate import solve_ivp

BARE = {"stops": 0, "potholes_per_km": 0.0, "engine": 0.0, "manoeuvres": 0.0}


def spectrum(values, rate_hz):
    return scipy.signal.welch(values, rate_hz, nperseg=int(8 * rate_hz), axis=0)


@pytest.mark.parametrize("road_class", ["A", "C"])
def test_body_moves_as_the_standards_road_makes_it(road_class):
    """Displacement spectrum G v / f² (2 pi n0 ... cancels) times the body's response."""
    drive = Drive(road_class, speed=20.0, **BARE)
    frequency, power = np.zeros(1), 0.0
    for seed in range(3):
        motion = drive_on_road(np.random.default_rng(seed), 200.0, 120.0, drive)
        frequency, one = spectrum(motion.reference[:, 2], 200.0)
        power = power + one / 3
    inside = (frequency > 1) & (frequency < 34)
    f = frequency[inside]
    displacement = ROUGHNESS[road_class] * 0.1 ** 2 * 20.0 / f ** 2
    transfer = np.abs(2j * np.pi * f * drive.car.acceleration(2j * np.pi * f)) ** 2
    ratio = power[inside] / (displacement * transfer)
    assert abs(ratio.mean() - 1) < 0.1  # the speed wanders by a third, its mean by a few per cent
    thirds = np.array_split(ratio, 3)
    assert max(map(np.mean, thirds)) / min(map(np.mean, thirds)) < 1.15


def test_quarter_car_against_an_integration():
    car = QuarterCar()

    def profile(t):
        return 0.01 * np.tanh(4 * t) ** 4 * np.sin(2 * np.pi * 3 * t)

    def right_side(t, x):
        body, body_speed, wheel, wheel_speed = x
        suspension = car.spring * (wheel - body) + car.damper * (wheel_speed - body_speed)
        return [body_speed, suspension / car.body, wheel_speed,
                (car.tyre * (profile(t) - wheel) - suspension) / car.wheel]

    t = np.linspace(0, 6, 3001)
    motion = solve_ivp(right_side, (0, 6), np.zeros(4), "DOP853", t, rtol=1e-9, atol=1e-12)
    body = np.array([right_side(*pair) for pair in zip(t, motion.y.T)])[:, 1]
    s = 6j * np.pi
    response = s * car.acceleration(s) * 0.01
    steady = np.imag(response * np.exp(s * t))
    assert np.allclose(body[t > 5], steady[t > 5], atol=1e-3 * abs(response))


def test_band_standstill_gravity_and_axes():
    drive = Drive("B", speed=20.0, stops=1, engine=0.2, gravity=True)
    motion = drive_on_road(np.random.default_rng(3), 100.0, 120.0, drive, (0.5, 30.0))
    values = motion.reference
    assert values.shape == (12_000, 3) and motion.oversampling * 100.0 >= 6400
    assert np.allclose(values.mean(axis=0), [0, 0, 9.80665], atol=0.25)
    frequency, power = spectrum(values - values.mean(axis=0), 100.0)
    assert power[frequency > 31].sum() < 1e-5 * power.sum()
    # somewhere it stands: only the engine's few tones are left, for 5 % of the drive at least
    quiet = np.std(values[:, 2].reshape(-1, 200), axis=1)
    assert quiet.min() < 0.3 and np.median(quiet) > 2 * quiet.min()
    standing = values[:, 2].reshape(-1, 200)[np.argmin(quiet)]
    lines = np.abs(np.fft.rfft((standing - standing.mean()) * np.hanning(200))) ** 2
    assert np.sort(lines)[-9:].sum() > 0.9 * lines.sum()
    upright = turned(motion, "zxy").reference
    assert np.array_equal(upright, values[:, [2, 0, 1]])


def test_potholes_are_short_and_strong():
    calm = Drive("A", 15.0, **BARE)
    holes = Drive("A", 15.0, **{**BARE, "potholes_per_km": 20.0})
    kurtosis = [scipy.stats.kurtosis(drive_on_road(np.random.default_rng(0), 100.0, 60.0,
                                                   drive).reference[:, 2])
                for drive in (calm, holes)]
    assert kurtosis[0] < 1 < 5 < kurtosis[1]


def test_drawn_drives_differ_and_come_again():
    drives = [draw_drive(np.random.default_rng(seed)) for seed in range(40)]
    assert len({drive.road_class for drive in drives}) == 4
    assert {drive.gravity for drive in drives} == {False, True}
    one, other = (drive_on_road(np.random.default_rng(1), 100.0, 5.0, drives[0]) for _ in "ab")
    assert np.array_equal(one.acceleration, other.acceleration)


@pytest.mark.parametrize("name", [*ROAD_CAUSES, *ROAD_VARIANTS, *UNCATALOGUED])
def test_effect_stands_out_of_the_noise(name):
    case = draw_road_case(3, {name}, duration_s=6.0)
    (cause, strength), = case.effect_rms.items()
    begun = case.truth[cause].get("begins_s", 0.0)
    assert strength >= 3 * case.noise_std * np.sqrt(1 - begun / 6.0) * 0.999
    assert np.isfinite(case.record.sensor).all() and np.isfinite(case.record.reference).all()
    assert np.all(np.diff(case.record.stamps_ns) > 0)
    json.dumps(case.truth)
    json.dumps(case.baseline.to_model())
    json.dumps(case.besides)


def test_without_causes_a_flat_sensor_leaves_its_noise():
    checked = 0
    for seed in range(30):
        case = draw_road_case(seed, duration_s=3.0)
        record = case.record
        if case.kind != "gain" or case.baseline.effects or "interference_bursts" in case.besides:
            continue
        if not np.array_equal(record.stamps_ns, record.sensor_stamps_ns):
            continue
        left = record.sensor[:, 0] - case.sensor.core["sensitivity"] * record.reference[:, 0]
        assert 0.9 < left.std() / case.noise_std < 1.1
        checked += 1
    assert checked >= 2


def test_surroundings_are_as_various_as_the_issue_asks():
    cases = [draw_road_case(seed, duration_s=2.0) for seed in range(40)]
    besides = [set(case.besides) for case in cases]
    for case, own in zip(cases, besides):
        # each reference has noise, some but little
        if case.besides["reference_noise"]["std"] < 0.02 * case.record.reference[:, 0].std():
            own.remove("reference_noise")
    for name in ("reference_noise", "quantization", "dropped_samples", "timestamp_jitter",
                 "interference_bursts"):
        assert 2 <= sum(name in own for own in besides) <= 38, name
    unequal = [len(case.record.sensor) != len(case.record.reference) for case in cases]
    assert 10 < sum(unequal) < 36
    assert {case.kind for case in cases} == {"gain", "oscillator"}
    assert any(case.baseline.effects for case in cases)


def test_a_road_case_is_drawn_again_bit_by_bit():
    one, other = (draw_road_case(6, {"gain_step", "offset"}, duration_s=5.0) for _ in "ab")
    assert one.truth == other.truth and set(one.truth) == {"gain_step", "offset"}
    assert np.array_equal(one.record.sensor, other.record.sensor)
    assert np.array_equal(one.record.reference, other.record.reference)
