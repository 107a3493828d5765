"""A hidden case is what it says: its effects are in the record and as strong as stated."""

import numpy as np
import pytest
import rig
from rig.hidden import EXCITATIONS, KINDS, draw_case, draw_causes

from frac_accel import read_bag, simulate
from frac_accel.io.bag import read_temperature

pytestmark = pytest.mark.long

RATE = 2000.0
STAMPS = {"timestamp_jitter", "dropped_samples"}


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


# The rest of the second set and of the unknown kinds are drawn in test_rig_road.py.
ONLY_HERE = ("stiffness_drift", "quadratic_damping", "impact_stop", "second_resonance",
             "reference_low_pass", "gain_modulation", "moving_delay", "duffing_mount")


@pytest.mark.parametrize("cause", rig.CAUSES + ONLY_HERE)
def test_effect_stands_out_of_the_noise(cause):
    case = draw_case(3, {cause})
    record = case.record
    assert case.causes == set(case.truth) == set(case.effect_rms) == {cause}
    assert case.effect_rms[cause] >= 3 * case.noise_std
    if cause == "timestamp_jitter":
        late = record.sensor_stamps_ns - record.stamps_ns
        assert 0.9 < late.std() / (1e9 * case.truth[cause]["rms_s"]) < 1.1
        assert (np.diff(record.sensor_stamps_ns) > 0).all()
    elif cause == "dropped_samples":
        lost = 1 - len(record.sensor) / len(record.reference)
        assert abs(lost - case.truth[cause]["fraction"]) < 4 * np.sqrt(lost / len(record.reference))
    else:
        # With the model in use, the residual is the effect and the noise.
        without = simulate(case.model(), record.reference, RATE)[:, 0]
        later = slice(len(without) // 4, None)  # the start in mid-motion has died away
        residual = rms((record.sensor[:, 0] - without)[later])
        stated = np.hypot(case.effect_rms[cause], case.noise_std)
        assert 0.4 < residual / stated < 2.0


def test_a_variant_stands_for_its_cause():
    case = draw_case(3, {"hardening_hysteresis"})
    assert case.causes == {"hysteresis"}
    assert case.truth["hysteresis"]["beta"] + case.truth["hysteresis"]["gamma"] < 0
    assert case.effect_rms["hysteresis"] >= 3 * case.noise_std


@pytest.mark.parametrize("kind, excitation", list(zip(KINDS, EXCITATIONS)))
def test_without_causes_the_residual_of_the_model_in_use_is_the_noise(kind, excitation):
    case = draw_case(4, kind=kind, excitation=excitation)
    without = simulate(case.model(), case.record.reference, RATE)[:, 0]
    later = slice(len(without) // 3, -200)
    residual = (case.record.sensor[:, 0] - without)[later]
    assert 0.95 < residual.std() / case.noise_std < 1.05


@pytest.mark.parametrize("seed", range(2))
def test_no_effect_is_hidden_by_another(seed):
    case = draw_case(seed, {"sensitivity_error", "offset", "clipping"})
    x, limits = case.record.sensor[:, 0], case.truth["clipping"]
    assert x.max() == limits["upper"] and np.sum(x == limits["upper"]) >= 3
    assert x.min() == limits["lower"] and np.sum(x == limits["lower"]) >= 3


def test_drawn_sets_of_causes_can_be_told_apart():
    drawn = [draw_causes(seed, 3) for seed in range(300)]
    assert set().union(*drawn) == set(rig.CAUSES)
    assert not any({"core_parameter_shift", "fractional_damping"} <= causes for causes in drawn)
    drawn = [draw_causes(seed, 3, rig.SECOND_SET) for seed in range(300)]
    assert set().union(*drawn) == set(rig.SECOND_SET)
    assert not any({"offset_drift", "thermal_offset"} <= causes for causes in drawn)


def test_a_case_is_drawn_again_bit_by_bit():
    one, other = draw_case(6, {"clipping", "offset"}), draw_case(6, {"offset", "clipping"})
    assert one.truth == other.truth
    assert np.array_equal(one.record.sensor, other.record.sensor)
    assert not np.array_equal(one.record.sensor[:100],
                              draw_case(7, {"clipping", "offset"}).record.sensor[:100])


def test_the_bag_holds_what_the_samples_are(tmp_path):
    case = draw_case(9, {"temperature_sensitivity", "dropped_samples"})
    case.write(tmp_path / "case.mcap")
    read = read_bag(tmp_path / "case.mcap")
    reference, sensor, (stamps_ns, celsius) = case.samples()
    for samples, topic in ((reference, "/imu/reference"), (sensor, "/imu/data_raw")):
        assert np.array_equal(read[topic].stamps_ns, samples.stamps_ns)
        assert np.array_equal(read[topic].values, samples.values)
    temperature = read_temperature(tmp_path / "case.mcap")
    assert np.array_equal(temperature.stamps_ns, stamps_ns)
    assert np.array_equal(temperature.celsius, celsius)


@pytest.mark.parametrize("cause, times_noise", [("sensitivity_error", 0.1),
                                                ("cubic_stiffness", 10.0), ("time_delay", 1.0)])
def test_a_wanted_strength_is_met(cause, times_noise):
    case = draw_case(8, {cause}, times_noise=times_noise)
    assert abs(np.log(case.effect_rms[cause] / case.noise_std / times_noise)) < 0.11
