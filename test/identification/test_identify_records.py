"""Several records of one sensor agree, and those of different sensors do not."""

import dataclasses
import json

import numpy as np
import pytest
import rig
from scipy.signal import butter, sosfiltfilt

from frac_accel import SensorModel, identify
from frac_accel.cli import main
from frac_accel.errors import IdentificationError
from frac_accel.identification.judge.records import agreement, combine
from frac_accel.io.bag import write_bag
from frac_accel.io.samples import Samples
from frac_accel.record import Record

pytestmark = pytest.mark.long

RATE_HZ = 2000.0
PARAMETERS = ("sensitivity", "natural_frequency_hz", "damping_ratio", "delay_s")


def draw(rng, **ranges):
    return rig.draw_sensor(rng, RATE_HZ, "classical", ["time_delay"],
                           natural_frequency=(0.05, 0.2), damping_ratio=(0.05, 0.7), **ranges)


def record_of(rng, sensor, band_hz=(5.0, 700.0), snr_db=25.0, **noise):
    excitation = rig.band_noise(rng, RATE_HZ, 1.5, band_hz, (1.0, 0.0, 0.0), lead_s=0.5)
    record = rig.simulate_record(sensor, excitation, rng, snr_db=snr_db, **noise)
    return (Samples.of(record.stamps_ns, record.reference),
            Samples.of(record.sensor_stamps_ns, record.sensor))


def pairs_of(rng, *sensors, **options):
    return [Record.of(*record_of(rng, sensor, **options)) for sensor in sensors]


def truth(sensor):
    return np.array([sensor.core["sensitivity"], sensor.core["natural_frequency_hz"],
                     sensor.core["damping_ratio"], sensor.effects["time_delay"]["delay_s"]])


def test_records_of_one_sensor_agree_and_their_mean_covers_the_truth():
    rng = np.random.default_rng(20331)
    scores, p_values = [], []
    for _ in range(30):
        sensor = draw(rng)
        pairs = pairs_of(rng, sensor, sensor, sensor)
        result = identify(pairs, structure="oscillator")
        p_values.append(result.validation.records.p_value)
        values, std = (np.array([result.parameters[name][part] for name in (*PARAMETERS, "offset")])
                       for part in ("value", "std"))
        scores.append((values - np.r_[truth(sensor), 0.0]) / std)
    # at the level of 1 %, three of thirty have a chance of 0.3 %
    assert np.sum(np.array(p_values) < 0.01) <= 2
    assert 0.3 < np.mean(p_values) < 0.7
    # 150 correlated trials of 0.95
    assert np.mean(np.abs(scores) < 1.96) >= 0.88


def test_the_mean_is_better_than_each_record():
    rng = np.random.default_rng(20332)
    sensor = draw(rng)
    pairs = pairs_of(rng, *[sensor] * 4)
    single = identify(pairs[0], structure="oscillator")
    common = identify(pairs, structure="oscillator")
    for name in PARAMETERS:
        assert common.parameters[name]["std"] == pytest.approx(
            single.parameters[name]["std"] / 2, rel=0.25)
    table = common.validation.records.nrmse
    noise = 10 ** (-25 / 20)
    assert table.shape == (4, 4)
    np.testing.assert_allclose(table, noise, rtol=0.1)
    assert common.held_out_nrmse == pytest.approx(noise, rel=0.1)
    assert "the 4 records agree" in common.validation.verdict[-1]


def test_another_natural_frequency_is_named():
    rng = np.random.default_rng(20333)
    first = draw(rng)
    core = {**first.core, "natural_frequency_hz": 1.02 * first.core["natural_frequency_hz"]}
    second = dataclasses.replace(first, core=core)
    result = identify(pairs_of(rng, first, first, second), structure="oscillator",
                      records=["monday", "tuesday", "friday"])
    records = result.validation.records
    assert not records.agree and records.birge_factor > 1
    assert records.worst_parameter == "natural_frequency_hz"
    assert "friday" in records.worst_records
    verdict = result.validation.verdict[-1]
    assert verdict.startswith("the records disagree")
    assert "natural_frequency_hz differs by" in verdict
    assert "not the same sensor or not the same mounting" in verdict
    assert "lacks something" not in verdict
    assert records.nrmse[0, 2] > 1.5 * records.nrmse[0, 1]


def test_an_incomplete_model_is_not_blamed_on_the_mounting_alone():
    """The same sensor, whose resonance below is unmodelled, on two bands of excitation."""
    rng = np.random.default_rng(20334)
    sensor = rig.draw_sensor(rng, RATE_HZ, "classical", ["time_delay", "mounting_resonance"],
                             natural_frequency=(0.1, 0.2), damping_ratio=(0.2, 0.7))
    pairs = [Record.of(*record_of(rng, sensor, band, snr_db=50.0))
             for band in ((5.0, 300.0), (5.0, 700.0))]
    result = identify(pairs, structure="oscillator")
    assert not result.validation.records.complete
    assert "the model lacks something" in result.validation.verdict[-1]


def test_auto_finds_the_damping_order_of_all_records():
    rng = np.random.default_rng(20335)
    sensor = rig.draw_sensor(rng, RATE_HZ, "fractional", ["time_delay"], damping_order=(0.45, 0.7),
                             damping_ratio=(0.1, 0.4), natural_frequency=(0.08, 0.15))
    result = identify(pairs_of(rng, sensor, sensor))
    assert result.structure == "fractional" and "other records" in result.reason
    order = result.parameters["damping_order"]
    assert abs(order["value"] - sensor.core["damping_order"]) < 4 * order["std"]


def test_transfer_functions_of_several_records_have_the_same_orders():
    rng = np.random.default_rng(20336)
    sensor = rig.draw_sensor(rng, RATE_HZ, "arx")
    result = identify(pairs_of(rng, sensor, sensor, snr_db=40.0), structure="arx")
    assert result.validation.records.agree
    frequency = np.linspace(10, 650, 60)
    true = SensorModel.from_dict(sensor.to_model()).frequency_response(frequency)
    error = np.abs(result.model.frequency_response(frequency) / true - 1)
    assert np.median(error) < 0.01


def test_open_parameters_have_a_mean():
    """A resonance 15 times above the excitation: linearised covariances of it mean nothing."""
    rng = np.random.default_rng(20338)
    sensor = rig.draw_sensor(rng, RATE_HZ, "classical", ["time_delay"],
                             natural_frequency=(0.3, 0.3), damping_ratio=(0.5, 1.0))
    pairs = pairs_of(rng, sensor, sensor, band_hz=(1.0, 40.0), snr_db=30.0)
    result = identify(pairs, structure="oscillator")
    assert result.validation.records.agree
    records = result.validation.records
    assert np.any(records.std[:, 1:3] > records.values[:, 1:3])
    sensitivity = result.parameters["sensitivity"]
    assert abs(sensitivity["value"] - sensor.core["sensitivity"]) < 4 * sensitivity["std"]
    assert result.held_out_nrmse == pytest.approx(10 ** (-30 / 20), rel=0.2)


def test_a_difference_that_the_parameters_leave_open_is_said():
    """Equal parameters, but each model predicts the other record badly."""
    table = np.array([[0.07, 0.22], [0.15, 0.09]])
    records = agreement(
        ["a", "b"], [Estimate(np.array([1.0, 0.0, 0.0]), np.eye(3))] * 2,
        combine([Estimate(np.array([1.0, 0.0, 0.0]), np.eye(3))] * 2), table, [0.1, 0.1], True)
    assert "but not in what they predict: b to 22.00% by the model of a, to 9.00%" \
        in records.words()


@dataclasses.dataclass
class Estimate:
    """What `combine` needs of a fit."""

    values: np.ndarray
    covariance: np.ndarray
    names: tuple = ("sensitivity", "offset", "delay_s")

    @property
    def std(self):
        return np.sqrt(np.diag(self.covariance))


def test_weighted_mean_and_birge_factor():
    """Two values of standard uncertainty 1 and 2 at distance d: weights 4 to 1, chi^2 = d^2 / 5."""
    near = combine([Estimate(np.array([1.0, 0.0, 3e-4]), np.diag([1.0, 1.0, 0.0])),
                    Estimate(np.array([2.0, 99.0, 5e-4]), np.diag([4.0, 1.0, 0.0]))])
    assert near.values == pytest.approx([1.2, 49.5, 3e-4])
    assert near.covariance[0, 0] == pytest.approx(0.8)
    assert (near.statistic, near.freedom, near.birge_factor) == (pytest.approx(0.2), 1, 1.0)
    far = combine([Estimate(np.array([1.0, 0.0, 3e-4]), np.diag([1.0, 1.0, 0.0])),
                   Estimate(np.array([11.0, 0.0, 3e-4]), np.diag([4.0, 1.0, 0.0]))])
    assert far.statistic == pytest.approx(20)
    assert far.covariance[0, 0] == pytest.approx(0.8 * 20)


def test_command_of_two_bags(tmp_path, capsys):

    rng = np.random.default_rng(20337)
    first = draw(rng)
    core = {**first.core, "sensitivity": 1.05 * first.core["sensitivity"]}
    bags = []
    for name, sensor in (("a", first), ("b", dataclasses.replace(first, core=core))):
        reference, measured = record_of(rng, sensor)
        bags.append(str(tmp_path / f"{name}.mcap"))
        write_bag(bags[-1], {"/imu/reference": reference, "/imu/data_raw": measured})
    out, result = tmp_path / "m.yaml", tmp_path / "r.json"
    assert main(["identify", *bags, "-o", str(out), "--json", str(result),
                 "--structure", "oscillator"]) == 0
    printed = capsys.readouterr().out
    assert "verdict: the records disagree" in printed and "all together" in printed
    said = json.loads(result.read_text())["validation"]["records"]
    assert said["worst_parameter"] == "sensitivity" and np.shape(said["nrmse"]) == (2, 2)
    metadata = SensorModel.load(out).metadata
    assert metadata["provenance"]["bag"] == "a.mcap"
    assert metadata["provenance"]["further_bags"][0]["bag"] == "b.mcap"
    assert metadata["validation"]["records"]["agree"] is False
    assert main(["identify", *bags, "-o", bags[1]]) == 2
    assert "is the input" in capsys.readouterr().err


def test_no_record_is_refused():
    with pytest.raises(IdentificationError, match="no record given"):
        identify([])


def test_a_delay_that_no_model_holds_is_refused_in_words_of_its_own():
    rng = np.random.default_rng(5)
    motion = sosfiltfilt(butter(2, 0.2, output="sos"), rng.normal(size=3012))
    stamps = np.round(1e9 * 2 * np.arange(3000))
    pair = tuple(Samples.of(stamps, np.outer(values, [1.0, 0, 0]))
                 for values in (motion[12:], motion[6:-6] + 0.01 * rng.normal(size=3000)))
    with pytest.raises(IdentificationError, match="no sensor: time_delay, delay_s: 12.* given"):
        identify(pair)
