"""Two topics on one time base: exact signals, whatever the rates, stamps and clocks."""

import re

import numpy as np
import pytest
import rig
from exact_sines import oscillator
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from frac_accel import SensorModel, diagnose, identify
from frac_accel.errors import FracAccelError
from frac_accel.io.samples import Samples
from frac_accel.model.core import Gain, Oscillator
from frac_accel.record import Record
from frac_accel.validation import validate

EPOCH_NS = 1_700_000_000_000_000_000


def samples(seconds, values):
    """Samples at instants [s], of three axes or of x."""
    values = np.asarray(values)
    if values.ndim == 1:
        values = np.stack([values, np.zeros_like(values), np.zeros_like(values)], axis=1)
    return Samples.of(EPOCH_NS + np.round(np.asarray(seconds) * 1e9).astype(np.int64), values)


def multisine(rng, highest_hz, lines=15):
    """Function of time with random lines below a frequency, and a constant such as gravity."""
    frequency, phase = rng.uniform(0.01, 1, lines) * highest_hz, rng.uniform(0, 7, lines)
    amplitude, constant = rng.uniform(0.2, 1, lines), rng.uniform(-10, 10)

    def motion(t):
        return constant + np.sin(2 * np.pi * np.multiply.outer(t, frequency) + phase) @ amplitude
    return motion


def coloured(rng, n, pole=0.9):
    """Three independent axes of noise."""
    return lfilter([1], [1, -pole], rng.normal(size=(n + 2000, 3)), axis=0)[2000:]


def instants(record):
    """The record's instants [s]."""
    start = (record.start_ns - EPOCH_NS) * 1e-9
    return start + np.arange(len(record)) / record.sampling_rate_hz


def errors(record, motion, answer):
    """Largest errors of both signals where they count, over their standard deviations."""
    t, used = instants(record), record.valid
    found = []
    for values, exact in ((record.reference[:, 0], motion(t)),
                          (record.sensor[:, 0], answer(t + record.lag_s))):
        found.append(np.max(np.abs(values - exact)[used]) / np.std(exact))
    return found


@pytest.mark.parametrize("rates", [(10.0, 14.2), (14.2, 10.0), (100.0, 400.0), (400.0, 100.0),
                                   (1000.0, 13.0), (100.0, 100.05), (100.0, 99.95), (100.0, 100.5),
                                   (100.0, 99.5)])
@pytest.mark.parametrize("seed", range(3))
def test_unequal_rates_are_compared_on_the_slower_ones_instants(rates, seed):
    rng = np.random.default_rng([20261122, seed])
    slower = min(rates)
    motion, answer = (multisine(rng, 0.4 * slower) for _ in range(2))
    times = [rng.uniform(0, 2 / slower) + np.arange(int(3000 * rate / slower)) / rate
             for rate in rates]
    record = Record.of(samples(times[0], motion(times[0])), samples(times[1], answer(times[1])))
    assert max(errors(record, motion, answer)) < 1e-3
    assert len(record) > 0.98 * 3000 and record.valid.all()
    assert record.sampling_rate_hz == pytest.approx(slower, rel=6e-3)
    assert record.band_hz == pytest.approx(0.4 * slower, rel=6e-3)
    assert record.lag_s == 0
    words, = record.words
    assert f"{rates[0]:g} Hz" in words and f"up to {record.band_hz:.4g} Hz" in words


def test_words_name_rates_and_band():
    rng = np.random.default_rng(0)
    t, s = np.arange(1000) / 10, np.arange(1420) / 14.2
    record = Record.of(samples(t, rng.normal(size=1000)), samples(s, rng.normal(size=1420)))
    assert record.words == ("the reference has 10 Hz and the sensor has 14.2 Hz: compared at 10 Hz "
                            "up to 4 Hz",)
    assert record.resampled == ("sensor",)


@pytest.mark.parametrize("seed", range(3))
def test_what_lies_above_the_band_does_not_fold_into_it(seed):
    rng = np.random.default_rng(seed)
    motion = multisine(rng, 4.0)
    t, s = np.arange(1000) / 10, np.arange(10_000) / 100
    hum = np.sin(2 * np.pi * rng.uniform(6.1, 49) * s)
    record = Record.of(samples(t, motion(t)), samples(s, motion(s) + hum))
    assert max(errors(record, motion, motion)) < 1e-3


def test_one_rate_changes_no_value():
    rng = np.random.default_rng(1)
    values = rng.normal(size=(2, 3000))
    t = np.arange(3000) / 100
    record = Record.of(samples(t, values[0]), samples(t + 0.0021, values[1]))
    assert record.band_hz is None and record.resampled == () and record.words == ()
    assert np.array_equal(record.reference[:, 0], values[0])
    assert np.array_equal(record.sensor[:, 0], values[1])
    assert record.lag_s == pytest.approx(0.0021, abs=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_a_lost_sample_of_the_resampled_topic_does_not_count(seed):
    rng = np.random.default_rng(seed)
    motion, answer = multisine(rng, 4.0), multisine(rng, 4.0)
    t, s = np.arange(3000) / 10, np.arange(12_000) / 40
    kept = rng.random(len(s)) > 0.005
    kept[6000:6080] = False
    record = Record.of(samples(t, motion(t)), samples(s[kept], answer(s[kept])))
    assert max(errors(record, motion, answer)) < 0.02
    assert 0.85 < record.valid.mean() < 0.99
    gap = np.abs(instants(record) - 151) < 1.4
    assert not record.valid[gap].any()


@pytest.mark.parametrize("seed", range(3))
def test_right_stamps_of_uneven_instants_are_believed(seed):
    rng = np.random.default_rng(seed)
    motion, answer = multisine(rng, 1.0), multisine(rng, 1.0)
    # two messages a tenth of a second, at another distance each time, as a CAN bus has them
    t = np.sort(np.r_[np.arange(3000) / 10, np.arange(3000) / 10 + rng.uniform(0.01, 0.09, 3000)])
    s = np.arange(2990) / 10 + 0.03
    record = Record.of(samples(t, motion(t)), samples(s, answer(s)))
    assert record.topics[0].clock.kind == "uneven"
    assert max(errors(record, motion, answer)) < 1e-3
    assert "(uneven)" in record.words[0]
    assert any("uneven" in words for words in record.topics[0].integrity(0).words)


@pytest.mark.parametrize("sensor_hz", [195.0, 204.0])
@pytest.mark.parametrize("seed", range(2))
def test_what_is_near_a_gap_is_as_good_as_the_rest(seed, sensor_hz):
    rng = np.random.default_rng(seed)
    motion = multisine(rng, 60.0)
    t, s = np.arange(12_000) / 200, np.arange(60 * sensor_hz) / sensor_hz
    kept = rng.random(len(s)) > 0.02
    record = Record.of(samples(t, motion(t)), samples(s[kept], motion(s[kept])))
    one = record.comparable(0, record.valid)
    error = (one.sensor - one.reference)[100:-100, 0][record.valid[100:-100]]
    assert np.sqrt(np.mean(error**2)) < 0.005 * np.std(one.reference[:, 0])


@pytest.mark.parametrize("apart_s", [2e-5, 0.0])
@pytest.mark.parametrize("size", [2, 4, 10])
@pytest.mark.parametrize("seed", range(2))
def test_samples_in_batches_are_uniform(size, seed, apart_s):
    rng = np.random.default_rng([seed, size])
    motion, answer = multisine(rng, 8.0), multisine(rng, 8.0)
    t = np.arange(4000) / 100
    # a batch is sent when its last sample is there, and now and then late
    sent = t[size - 1::size] + 1e-4 * rng.random(len(t[size - 1::size]))
    late = rng.random(len(sent)) < 0.03
    sent[late] += rng.uniform(0, 0.6 * size / 100, late.sum())
    stamps = np.repeat(sent, size) + np.tile(np.arange(size) * apart_s, len(sent))
    record = Record.of(samples(t, motion(t)), samples(stamps, answer(t[:len(stamps)])))
    assert record.topics[1].clock.kind == "batches"
    assert record.topics[1].clock.rate_hz == pytest.approx(100, rel=1e-5)
    exact = answer(instants(record))
    assert np.max(np.abs(record.sensor[:, 0] - exact)) < 0.05 * np.std(exact)
    assert any("batches" in words for words in record.integrity(0).words)


@pytest.mark.parametrize("seed", range(4))
def test_late_stamps_leave_the_instants_where_they_are(seed):
    rng = np.random.default_rng(seed)
    n = 5000
    late = np.where(rng.random(n) < 0.05, rng.exponential(1.5, n), 0.0)
    # a message waits for the one before it
    stamps = np.maximum.accumulate(np.arange(n) + late) + 1e-3 * np.arange(n) / n
    values = rng.normal(size=(2, n))
    record = Record.of(samples(np.arange(n) / 100, values[0]), samples(stamps / 100, values[1]))
    assert record.sampling_rate_hz == pytest.approx(100, rel=1e-4)
    used = record.valid
    assert used.mean() > 0.98
    assert np.mean(record.sensor[used, 0] == values[1, :len(record)][used]) > 0.99


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("offset_s", [-3605.25, -7.31, 4.013, 86400.5])
def test_seconds_between_clocks_are_found_said_and_taken_out(offset_s, seed):
    rng = np.random.default_rng([seed, int(abs(offset_s))])
    n, t = 4000, np.arange(4000) / 100
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    motion = coloured(rng, n)
    answer = motion @ turn.T + 0.2 * motion.std() * rng.normal(size=(n, 3))
    record = Record.of(samples(t, motion), samples(t + offset_s, answer))
    assert record.offset_s == pytest.approx(offset_s, abs=5 * record.offset_std_s)
    assert record.offset_std_s < 1e-3
    assert record.taken_out_s == record.offset_s
    assert len(record) > n - 3
    direction = "ahead of" if offset_s > 0 else "behind"
    assert direction in record.words[0] and "taken out" in record.words[0]
    said = float(re.search(r"clock is (\S+) ±", record.words[0])[1])
    assert said == pytest.approx(abs(offset_s), abs=2e-3)


@pytest.mark.parametrize("seed", range(4))
def test_a_late_reference_is_said_and_stays(seed):
    rng = np.random.default_rng(seed)
    n, t = 6000, np.arange(6000) / 100
    motion = coloured(rng, n)
    record = Record.of(samples(t + 0.2, motion), samples(t, motion + 0.3 * rng.normal(size=(n, 3))))
    assert record.taken_out_s == 0
    assert record.offset_s == pytest.approx(-0.2, abs=2e-3)
    assert "before the reference" in record.words[0]


def test_unrelated_topics_have_no_offset():
    found = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(1000, 5000))
        t, pole = np.arange(n) / 100, rng.choice([0.0, 0.9, 0.99])
        record = Record.of(samples(t, coloured(rng, n, pole)), samples(t, coloured(rng, n, pole)))
        assert record.taken_out_s == 0
        found += record.offset_s is not None
    assert found <= 1


def test_no_time_in_common_and_nothing_alike_is_refused():
    rng = np.random.default_rng(3)
    t = np.arange(2000) / 100
    with pytest.raises(FracAccelError, match="no time in common"):
        Record.of(samples(t, rng.normal(size=(2000, 3))),
                  samples(t + 500, rng.normal(size=(2000, 3))))


@pytest.mark.parametrize("place", [0, 1, 1000, 1999])
@pytest.mark.parametrize("which", [0, 1])
def test_a_stamp_a_year_off_is_one_line(place, which):
    rng = np.random.default_rng(4)
    topics = []
    for index in range(2):
        t = np.arange(2000) / 100
        if index == which:
            t[place] += -3.15e7 if place == 0 else 3.15e7
        topics.append(samples(t, rng.normal(size=2000)))
    with pytest.raises(FracAccelError) as caught:
        Record.of(*topics)
    assert "\n" not in str(caught.value)
    assert ("reference", "sensor")[which] in str(caught.value)
    assert "the stamps jump by 3.15e+07 s" in str(caught.value)


def test_absurd_stamps_are_one_line():
    rng = np.random.default_rng(5)
    stamps = np.sort(rng.integers(-2**62, 2**62, 500))
    one = Samples.of(stamps, rng.normal(size=(500, 3)))
    with pytest.raises(FracAccelError):
        Record.of(one, samples(np.arange(500) / 100, rng.normal(size=500)))


def two_devices(seed, reference_hz, sensor_hz):
    """A classical sensor with a delay, and the two topics, each sampled by its own device.

    The band ends below the Nyquist frequency of either, and noise is 60 dB down.
    """
    rng = np.random.default_rng([20261122, seed])
    fine = 1600.0
    sensor = rig.draw_sensor(rng, fine, "classical", ["time_delay"],
                             natural_frequency=(0.01, 0.02), damping_ratio=(0.2, 0.6))
    excitation = rig.band_noise(rng, fine, 50.0, (0.5, 35.0), (1.0, 0.0, 0.0), lead_s=1.0)
    record = rig.simulate_record(sensor, excitation, rng, snr_db=np.inf)
    t = (record.stamps_ns - record.stamps_ns[0]) * 1e-9
    topics = []
    for rate, values, noise in ((reference_hz, record.reference, 0), (sensor_hz, record.clean, 1)):
        at = np.arange(int(t[-1] * rate) - 1) / rate
        found = CubicSpline(t, values)(at)
        topics.append(samples(at, found + noise * 1e-3 * found[:, 0].std()
                              * rng.normal(size=found.shape)))
    return sensor, topics


@pytest.mark.parametrize("rates", [(200.0, 200.1), (200.0, 199.0), (400.0, 100.0), (100.0, 400.0)])
def test_a_sensor_is_identified_across_rates(rates):
    sensor, topics = two_devices(1, *rates)
    result = identify(Record.of(*topics), structure="oscillator")
    for name in ("natural_frequency_hz", "damping_ratio", "sensitivity"):
        assert result.parameters[name]["value"] == pytest.approx(sensor.core[name], rel=5e-3)
    delay = result.parameters["delay_s"]["value"]
    assert delay == pytest.approx(sensor.effects["time_delay"]["delay_s"], abs=3e-5)
    found = validate(tuple(topics), result.model)
    assert found.simulation.total.nrmse < 0.01
    assert found.comparison.corrected.total.nrmse < 0.03
    assert found.comparison.corrected.total.band_hz[1] <= 0.4 * min(rates) + 1e-9


@pytest.mark.long
def test_rates_that_differ_a_little_become_neither_delay_nor_skew():
    sensor, topics = two_devices(2, 200.0, 200.1)
    found = diagnose(tuple(topics))
    assert {finding.cause for finding in found.findings} <= {"time_delay"}
    for finding in found.findings:
        assert finding.effect.delay_s == pytest.approx(sensor.effects["time_delay"]["delay_s"],
                                                       abs=3e-5)


def test_what_the_slower_topic_cannot_show_bends_no_fit():
    """Motion up to the slower topic's Nyquist frequency, of which the band ends at four fifths."""
    rng = np.random.default_rng(1)
    s = 2j * np.pi * np.sort(rng.uniform(1, 49.5, 300))
    size = rng.uniform(0.03, 0.1, 300) * np.exp(2j * np.pi * rng.random(300))

    def topic(rate, start, count, response):
        t = start + np.arange(count) / rate
        values = np.real(np.exp(np.outer(t, s)) @ (size * response))
        noise = 0.003 * rng.standard_normal(count)
        return Samples.of(np.round(1e9 * t).astype(np.int64),
                          np.c_[values + noise, np.zeros((count, 2))])

    def diagnosed(ratio):
        output = oscillator(s, 35.0, 0.3)
        return diagnose((topic(370.0, 0.0, 11_100, 1.0), topic(100.0, 0.0031, 2980, output)),
                        SensorModel(Oscillator(35.0, ratio)))
    right = diagnosed(0.3)
    assert (right.verdict, right.findings) == ("consistent", [])
    assert right.extended["nrmse"] < 0.01
    moved = diagnosed(0.25)
    assert [finding.cause for finding in moved.findings] == ["core_parameter_shift"]
    assert abs(moved.findings[0].effect.damping_ratio / 0.3 - 1) < 0.01


def at_two_clocks(topics, offset_s):
    """Topics with the sensor's clock ahead by so much."""
    reference, sensor = topics
    return reference, sensor._replace(stamps_ns=sensor.stamps_ns + round(offset_s * 1e9))


@pytest.mark.parametrize("rates, offset_s", [((100.0, 400.0), 12.34), ((400.0, 100.0), -7.77),
                                             ((200.0, 201.0), 86400.0)])
def test_a_sensor_is_identified_and_judged_across_clocks(rates, offset_s):
    """Seconds between the clocks are taken out, whatever the rates; the band is stated."""
    sensor, topics = two_devices(3, *rates)
    pair = at_two_clocks(topics, offset_s)
    found = identify(pair, structure="oscillator")
    for name in ("natural_frequency_hz", "damping_ratio", "sensitivity"):
        assert found.parameters[name]["value"] == pytest.approx(sensor.core[name], rel=5e-3)
    judged = validate(pair, found.model)
    assert judged.simulation.total.nrmse < 0.01
    assert judged.comparison.corrected.total.nrmse < 0.03
    for words in (found.notes, judged.words):
        assert any("clock is" in line and "taken out" in line for line in words)
        band, = (float(re.search(r"up to (\S+) Hz", line)[1]) for line in words
                 if "compared at" in line)
        assert band == pytest.approx(0.4 * min(rates), rel=6e-3)


def test_a_bus_and_a_phone():
    """10 Hz against 14 Hz, clocks that differ by seconds, a flat sensor."""
    rng = np.random.default_rng(20261122)
    motion = multisine(rng, 2.0, 40)
    t, s = np.arange(3000) / 10, np.arange(4200) / 14
    answer = 1.03 * motion(s)
    answer += 0.01 * answer.std() * rng.normal(size=len(s))
    pair = samples(t, motion(t)), samples(s + 3.21, answer)
    found = identify(pair, structure="gain")
    assert found.parameters["sensitivity"]["value"] == pytest.approx(1.03, rel=2e-3)
    assert abs(found.parameters["delay_s"]["value"]) < 0.01
    assert any("3.21" in note and "taken out" in note for note in found.notes)
    assert validate(pair, found.model).comparison.corrected.total.nrmse < 0.02
    assert diagnose(pair, found.model).findings == []
    wrong = diagnose(pair, SensorModel(Gain(0.9)))
    finding, = wrong.findings
    assert finding.cause == "sensitivity_error"
    assert finding.effect.gain == pytest.approx(1.03 / 0.9, rel=3e-3)
    for words in (found.notes, wrong.integrity.words, validate(pair, found.model).words):
        assert any("clock is 3.2" in line and "taken out" in line for line in words)
        assert any("up to 4 Hz" in line for line in words)


@pytest.mark.parametrize("rates", [(100.0, 400.0), (200.0, 200.0)])
def test_a_late_reference_is_put_on_no_sensors_stamps(rates, tmp_path):
    """As of a CAN bus: the sensor seems to lead by 80 ms."""
    sensor, (reference, raw) = two_devices(4, *rates)
    late = reference._replace(stamps_ns=reference.stamps_ns + 80_000_000)
    found = identify((late, raw), structure="oscillator")
    lead = 0.08 - sensor.effects["time_delay"]["delay_s"]
    fault, = found.model.reference_faults
    assert fault.delay_s == pytest.approx(lead, abs=1e-4)
    assert found.model.axis("x").delay_s == 0
    assert any("nothing is taken out of the sensor's stamps" in note for note in found.notes)
    found.model.save(tmp_path / "model.yaml")
    again = SensorModel.load(tmp_path / "model.yaml")
    judged = validate((late, raw), again)
    assert judged.simulation.total.nrmse < 0.01
    assert judged.comparison.corrected.total.nrmse < 0.03
    # without its fault the reference and the corrected signal agree only at one time in the right
    assert validate((reference, raw), SensorModel(again.axis("x").core)
                    ).comparison.corrected.total.nrmse < 0.1
