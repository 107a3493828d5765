"""A sensor that lies turned: what is claimed of the signal that was turned back, the written model
gives again, and a late reference takes nothing out of the sensor's stamps."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from frac_accel import Samples, SensorModel, correct, diagnose, validate

RATE, GRAVITY, SECONDS = 10.0, 9.81, 400
# The vertical of the car is nearly the sensor's x: there roll and yaw are one angle.
QUARTER = np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]])


def drive(seed, late_s, left=0.3, offset=0.0):
    """A car's own values without gravity, late, and those of a phone that lies turned; what a
    sample truly is in the car's axes; and the rotation from the car's axes to the phone's."""
    rng = np.random.default_rng(seed)
    turn = Rotation.from_rotvec(np.radians(rng.uniform(-2, 2, 3))).as_matrix() @ QUARTER
    fine = 100.0
    t = np.arange(0, SECONDS, 1 / fine)
    slow = butter(4, 1.0, fs=fine, output="sos")
    motion = sosfiltfilt(slow, rng.normal(size=(len(t), 3)), axis=0) * [1, 0.8, 0.02]
    motion /= motion[:, 0].std()
    shakes = sosfiltfilt(slow, rng.normal(size=(len(t), 3)), axis=0)
    shakes *= left / shakes[:, 0].std()
    at = np.arange(1.0, SECONDS - 2, 1 / RATE)

    def read(values, when):
        return np.stack([np.interp(when, t, axis) for axis in values.T], axis=1)
    car = read(motion, at - late_s) * [1, 1, 0]
    phone = (read(motion + shakes, at) + [offset, 0, GRAVITY]) @ turn.T
    stamps = np.round(1e9 * (1000 + at))
    return Samples.of(stamps, car), Samples.of(stamps, phone), read(motion, at), turn


@pytest.mark.parametrize("seed", [1, 2])
def test_the_written_model_leaves_what_is_claimed(seed, tmp_path):
    *pair, true, turn = drive(seed, 0.2)
    found = diagnose(tuple(pair))
    delay, finding = found.findings
    assert (delay.cause, finding.cause) == ("reference_delay", "misalignment")
    assert abs(delay.effect.delay_s - 0.2) < 3 * delay.std["delay_s"] < 0.05
    # exactly the rotation that the signal was turned by, wherever its angles lie
    assert np.degrees(np.abs(finding.effect.rotation.T - turn)).max() < 3
    assert finding.std["roll_deg"] > 10 * finding.std["pitch_deg"]
    assert any("roll and yaw turn about one axis" in line for line in finding.evidence)
    found.model.save(tmp_path / "turned.yaml")
    model = SensorModel.load(tmp_path / "turned.yaml")
    judged = validate(tuple(pair), model)
    assert judged.turned
    assert judged.whole_nrmse == pytest.approx(found.extended["nrmse"], rel=0.1)
    assert 0.2 < judged.whole_nrmse < 0.4

    late, = model.reference_faults
    assert late.cause == "reference_delay"
    assert late.delay_s == pytest.approx(0.2, abs=0.02)
    # the corrected samples are the car's motion at their own instants
    corrected = correct(pair[1], model)
    at = np.searchsorted(pair[1].stamps_ns, corrected.stamps_ns)
    assert np.array_equal(pair[1].stamps_ns[at], corrected.stamps_ns)
    error = corrected.values[:, 0] - true[at, 0]
    assert np.std(error - error.mean()) < 0.4


def test_what_is_added_to_the_turned_signal_each_axis_has_its_share_of(tmp_path):
    """The model of a sensor that says its offset on another axis leaves what is claimed, too."""
    *pair, _, turn = drive(3, 0.0, left=0.05, offset=0.4)
    lost = slice(1500, 1620)  # a part that nobody has recorded
    keep = np.delete(np.arange(len(pair[0].stamps_ns)), lost)
    pair[0] = Samples.of(pair[0].stamps_ns[keep], pair[0].values[keep])
    found = diagnose(tuple(pair))
    assert {f.cause for f in found.findings} >= {"misalignment", "offset"}
    offset = next(f.effect.offset for f in found.findings if f.cause == "offset")
    assert offset == pytest.approx(0.4, abs=0.02)
    found.model.save(tmp_path / "turned.yaml")
    model = SensorModel.load(tmp_path / "turned.yaml")
    added = [next(e.offset for e in model.axis(axis).effects if e.cause == "offset")
             for axis in "xyz"]
    assert np.allclose(turn @ [offset, 0, 0], added, atol=0.02)
    judged = validate(tuple(pair), model)
    assert judged.whole_nrmse == pytest.approx(found.extended["nrmse"], rel=0.2)


def by_car(rng, rate_hz, seconds=120.0):
    """Instants [s] at eight times a rate, and motion of a car with gravity in its own axes."""
    t = np.arange(0, seconds, 1 / (8 * rate_hz))
    band = butter(3, (0.26 * rate_hz, 0.42 * rate_hz), "band", fs=8 * rate_hz, output="sos")
    motion = sosfiltfilt(band, rng.normal(size=(len(t), 3)), axis=0)
    return t, motion / motion.std(axis=0) * [0.5, 0.4, 1.0] + [0, 0, GRAVITY]


@pytest.mark.parametrize("seed", range(3))
def test_gravity_speaks_against_a_turn_that_a_filter_imitates(seed):
    """Motion that a moving average turns round, since it is faster than its first notch, was that
    of a sensor upside down, with 22 times the output left."""
    rng = np.random.default_rng([2026, seed])
    t, motion = by_car(rng, 50.0)
    length = rng.integers(28, 36)  # at eight times the rate
    late = np.cumsum(motion, axis=0)
    averaged = (late[length:] - late[:-length]) / length
    at = slice(length + 7, len(t), 8)
    reference, sensor = motion[at], averaged[7::8][:len(t[at])]
    sensor = sensor + rng.normal(0, 0.02, sensor.shape)
    stamps = np.round(1e9 * t[at])[:len(sensor)]
    found = diagnose((Samples.of(stamps, reference[:len(sensor)]), Samples.of(stamps, sensor)),
                     axis="z", time_limit_s=60)
    assert "misalignment" not in {finding.cause for finding in found.findings}
    assert found.baseline["rmse"] < 3  # twice gravity where it was turned


@pytest.mark.parametrize("seed", range(3))
def test_axes_that_are_just_reversed_keep_their_lattice(seed):
    """A turn by an angle that nothing shows made all values odd."""
    rng = np.random.default_rng([2027, seed])
    t, motion = by_car(rng, 50.0)
    stamps = np.round(1e9 * t[::8])
    step = rng.uniform(0.2, 0.4)
    sensor = motion[::8] * [-1, 1, -1] + rng.normal(0, 0.01, (len(stamps), 3))
    sensor = step * np.round(sensor / step)
    found = diagnose((Samples.of(stamps, motion[::8]), Samples.of(stamps, sensor)), axis="z",
                     time_limit_s=60)
    findings = {finding.cause: finding.effect for finding in found.findings}
    assert findings.keys() == {"misalignment", "quantization"}
    assert findings["quantization"].step == pytest.approx(step)
