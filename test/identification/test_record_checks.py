"""`identify` says what is wrong with a record, each fault in its own words."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import rig
from random_models import draw_sensor

from frac_accel import identify, write_bag
from frac_accel.cli import main
from frac_accel.errors import IdentificationError
from frac_accel.identification.response.excitation import require_excitation
from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC
from frac_accel.io.samples import Samples
from frac_accel.record import Record
from frac_accel.record.lattice import lattice_step

pytestmark = pytest.mark.long

RATE_HZ = 2000.0
X_ONLY = (1.0, 0.0, 0.0)
BAGS = Path(__file__).parents[2] / "bags"


def measured(seed, excitation=None, snr_db=40.0, samples=4000, amplitude=X_ONLY, **draw):
    """A random classical sensor with a delay, and its record."""
    rng = np.random.default_rng([20261201, seed])
    draw = {"natural_frequency": (0.05, 0.2), "damping_ratio": (0.05, 0.7), **draw}
    sensor = rig.draw_sensor(rng, RATE_HZ, "classical", ["time_delay"], **draw)
    if excitation is None:
        excitation = rig.band_noise(rng, RATE_HZ, samples / RATE_HZ, (5.0, 600.0), amplitude,
                                    lead_s=0.3)
    record = rig.simulate_record(sensor, excitation, rng, snr_db=snr_db)
    return (sensor, Samples.of(record.stamps_ns, record.reference),
            Samples.of(record.sensor_stamps_ns, record.sensor))


def with_x(samples, x):
    values = samples.values.copy()
    values[:, 0] = x
    return Samples.of(samples.stamps_ns, values)


def run(reference, sensor):
    return identify(Record.of(reference, sensor), structure="oscillator")


def assert_close(result, sensor, tolerance):
    for name in ("sensitivity", "natural_frequency_hz", "damping_ratio"):
        assert result.parameters[name]["value"] == pytest.approx(sensor.core[name], rel=tolerance)


def refused(reference, sensor, tmp_path, capsys):
    """Line with which the command refuses a pair, which the Python API raises too."""
    write_bag(tmp_path / "b.mcap", {REFERENCE_TOPIC: reference, RAW_TOPIC: sensor})
    assert main(["identify", str(tmp_path / "b.mcap"), "-o", str(tmp_path / "m.yaml"),
                 "--structure", "oscillator"]) == 2
    assert not (tmp_path / "m.yaml").exists()
    line, = capsys.readouterr().err.strip().splitlines()
    with pytest.raises(IdentificationError) as caught:
        run(reference, sensor)
    assert str(caught.value) in line
    return line


@pytest.mark.parametrize("copied", [
    lambda x: x,
    lambda x: 1.02 * x + 0.3,
    lambda x: (-9.80665 * x).astype(np.float32).astype(float),
    lambda x: np.round(x / 9.80665, 4),
    lambda x: np.round(x / 0.0039) * 0.0039,
    lambda x: np.r_[x[:1], x[:1], x[:-2]],
], ids=["equal", "scaled", "float32", "rounded", "quantised", "later"])
def test_copy_of_the_reference(copied, tmp_path, capsys):
    _, reference, _ = measured(0)
    copy = with_x(reference, copied(reference.values[:, 0]))
    assert "is a copy of the reference" in refused(reference, copy, tmp_path, capsys)


def test_sensor_far_below_its_resonance_is_no_copy():
    """60 dB, quantised to a hundredth of its standard deviation, and hardly any dynamics."""
    rng = np.random.default_rng(20261202)
    excitation = rig.band_noise(rng, RATE_HZ, 2.0, (1.0, 20.0), X_ONLY, lead_s=0.3)
    _, reference, sensor = measured(1, excitation, snr_db=60.0, natural_frequency=(0.3, 0.3))
    for step in (0.0, 0.003, 0.02):
        x = sensor.values[:, 0]
        quantised = np.round(x / step) * step if step else x
        assert run(reference, with_x(sensor, quantised)).nrmse < 0.02


def test_axes_in_proportion_are_noted():
    _, reference, sensor = measured(2)
    result = run(Samples.of(reference.stamps_ns, reference.values[:, [0, 0, 0]] * [1, 0.5, -2]),
                 sensor)
    assert any("axes x, y and z do not move independently" in note for note in result.notes)
    _, reference, sensor = measured(2, amplitude=(1.0, 0.7, 1.5))
    assert not any("axes" in note for note in run(reference, sensor).notes)
    repeated = Samples.of(sensor.stamps_ns, sensor.values[:, [0, 1, 0]])
    assert any("sensor's axes x and z depend" in note for note in run(reference, repeated).notes)


@pytest.mark.parametrize("seed", range(4))
def test_exchanged_topics(seed, tmp_path, capsys):
    sensor, reference, raw = measured(10 + seed, damping_ratio=(0.02, 0.2))
    line = refused(raw, reference, tmp_path, capsys)
    assert "reference and sensor are exchanged" in line
    found = float(re.search("a resonance at (.*) Hz", line)[1])
    assert found == pytest.approx(sensor.core["natural_frequency_hz"], rel=0.02)
    assert_close(run(reference, raw), sensor, 0.02)


def test_exchanged_topics_are_seen_by_all_structures():
    _, reference, raw = measured(14, damping_ratio=(0.02, 0.2), samples=2000)
    for structure in ("auto", "arx"):
        with pytest.raises(IdentificationError, match="are exchanged"):
            identify(Record.of(raw, reference), structure=structure)


def test_random_sensors_the_right_way_round_are_not_refused():
    """Of all kinds, with lags of the stamps and quantised reference and output in half of them."""
    rng = np.random.default_rng(20261206)
    for draw in range(12):
        sensor = draw_sensor(rng, RATE_HZ, natural_frequency=(0.01, 0.4))
        band = (5.0, RATE_HZ * rng.uniform(0.03, 0.45))
        excitation = rig.shock(RATE_HZ, 1.0, 1 / (4 * band[1]), amplitude=X_ONLY) if draw % 3 == 0 \
            else rig.band_noise(rng, RATE_HZ, 1.0, band, X_ONLY, lead_s=0.3)
        record = rig.simulate_record(sensor, excitation, rng, snr_db=rng.uniform(20, 60))
        reference = Samples.of(record.stamps_ns, record.reference)
        late_ns = int(rng.uniform(-3, 3) * 1e9 / RATE_HZ)
        raw = Samples.of(record.sensor_stamps_ns + late_ns, record.sensor)
        if draw % 2:
            reference, raw = (
                with_x(s, np.round(s.values[:, 0] / step) * step) for s, step in
                ((s, s.values[:, 0].std() * rng.uniform(0.01, 0.3)) for s in (reference, raw)))
        check = run(reference, raw).excitation
        assert (check.clipped, check.standing) == (0, 0)


@pytest.mark.parametrize("seed", range(40))
def test_one_sine_of_any_length_and_phase_is_refused(seed):
    rng = np.random.default_rng(seed)
    rate_hz, frequency, cycles = np.exp(rng.uniform(np.log([200, 0.005, 5]),
                                                    np.log([20_000, 0.4, 400])))
    phase = 2 * np.pi * frequency * np.arange(max(100, int(cycles / frequency)))
    sine = np.sin(phase + rng.uniform(0, 2 * np.pi)) + rng.uniform(-1, 1)
    with pytest.raises(IdentificationError, match="excites only"):
        require_excitation(sine + 1e-3 * rng.normal(size=len(sine)), rate_hz, 4)


def test_one_sine_is_told_where_more_is_needed(tmp_path, capsys):
    assert main(["identify", str(BAGS / "one_sine.mcap"), "-o", str(tmp_path / "m.yaml")]) == 2
    line, = capsys.readouterr().err.strip().splitlines()
    assert "excites only 300 Hz" in line and "at least 2 frequencies" in line
    assert "from 10 to 400 Hz, besides 300 Hz for instance 10 Hz" in line
    assert not (tmp_path / "m.yaml").exists()


def test_early_stamps_are_noted_and_not_refused():
    sensor, reference, raw = measured(15)
    early = Samples.of(raw.stamps_ns - 20_000_000, raw.values)
    result = run(reference, early)
    assert_close(result, sensor, 0.02)
    assert any("before the reference moves" in note for note in result.notes)


@pytest.mark.parametrize("sides", [(-2.0, 2.0), (-np.inf, 1.5), (-1.2, 1.2)])
@pytest.mark.parametrize("step", [0.0, 0.05])
def test_clipped_samples_of_the_sensor_do_not_count(sides, step):
    sensor, reference, raw = measured(20, snr_db=50)
    x = raw.values[:, 0]
    limits = np.round(np.array(sides) * x.std() / 0.05) * 0.05
    clipped = np.clip(x, *limits)
    if step:
        clipped = np.round(clipped / step) * step
    result = run(reference, with_x(raw, clipped))
    count = np.sum((x < limits[0] + step / 2) | (x > limits[1] - step / 2))
    assert result.excitation.clipped == pytest.approx(count, rel=0.05)
    assert_close(result, sensor, 0.01)
    note, = (note for note in result.notes if "clipped" in note)
    assert f"{limits[1]:.6g} in {result.excitation.clipped} of 4000 samples" in note


def test_mostly_clipped_sensor(tmp_path, capsys):
    _, reference, raw = measured(21)
    x = raw.values[:, 0]
    line = refused(reference, with_x(raw, np.clip(x, -0.7 * x.std(), 0.7 * x.std())), tmp_path,
                   capsys)
    assert "the sensor is clipped at -" in line and "too little is left" in line


def test_clipped_reference(tmp_path, capsys):
    _, reference, raw = measured(22)
    line = refused(with_x(reference, np.clip(reference.values[:, 0], -1.5, 1.8)), raw, tmp_path,
                   capsys)
    assert "the reference is clipped at -1.5 and 1.8 in" in line


UNCLIPPED = {
    "noise": lambda rng: rig.band_noise(rng, RATE_HZ, 2.0, (5.0, 600.0), X_ONLY, lead_s=0.3),
    "sweep": lambda rng: rig.swept_sine(RATE_HZ, 2.0, (2.0, 60.0), X_ONLY),
    "two sines": lambda rng: rig.sines(RATE_HZ, 2.0, [2.0, 50.0], [0.0, 1.0], X_ONLY, lead_s=0.3),
    "shock": lambda rng: rig.shock(RATE_HZ, 2.0, 1e-3, amplitude=X_ONLY),
    "bursts": lambda rng: rig.noise_bursts(rng, RATE_HZ, 2.0, (5.0, 600.0), [1, 0.3, 0.05], X_ONLY),
}


@pytest.mark.parametrize("kind", UNCLIPPED)
def test_quantised_crests_and_rests_are_not_clipped(kind):
    _, reference, raw = measured(23, UNCLIPPED[kind](np.random.default_rng(20261203)))
    x = raw.values[:, 0]
    for share in (0.007, 0.03, 0.1):
        step = share * np.max(np.abs(x))
        check = run(reference, with_x(raw, np.round(x / step) * step)).excitation
        assert (check.clipped, check.standing) == (0, 0), share


def test_sensor_unplugged_half_way():
    sensor, reference, raw = measured(30)
    x = raw.values[:, 0].copy()
    x[2000:] = 0.123
    result = run(reference, with_x(raw, x))
    assert_close(result, sensor, 0.02)
    assert result.excitation.standing == pytest.approx(2000, abs=2)
    assert any("the sensor stands still at 0.123 from 1 s to 2 s" in note for note in result.notes)


def test_sensor_unplugged_nearly_all_the_time(tmp_path, capsys):
    _, reference, raw = measured(31)
    x = raw.values[:, 0].copy()
    x[200:] = x[200]
    line = refused(reference, with_x(raw, x), tmp_path, capsys)
    assert "the sensor stands still" in line and "was the sensor connected?" in line


@pytest.mark.parametrize("lost", [np.nan, np.inf, 0.0, "frozen"])
def test_reference_lost_in_mid_run(lost):
    sensor, reference, raw = measured(32)
    x = reference.values[:, 0].copy()
    x[1500:1900] = x[1499] if lost == "frozen" else lost
    result = run(with_x(reference, x), raw)
    check = result.excitation
    assert check.missing + check.standing == pytest.approx(400, abs=2)
    assert_close(result, sensor, 0.03)


def test_ringing_after_the_reference_has_come_to_rest_counts():
    sensor, reference, raw = measured(33, rig.shock(RATE_HZ, 1.0, 1e-3, amplitude=X_ONLY),
                                      damping_ratio=(0.01, 0.01))
    assert np.sum(reference.values[:, 0] == 0) > 500
    result = run(reference, raw)
    assert result.excitation.standing == 0
    assert_close(result, sensor, 0.02)


def test_record_shorter_than_the_memory(tmp_path, capsys):
    _, reference, raw = measured(40, samples=1500, natural_frequency=(0.05, 0.05),
                                 damping_ratio=(3e-4, 3e-4))
    line = refused(reference, raw, tmp_path, capsys)
    assert "the record lasts 0.75 s" in line
    memory = float(re.search("takes at least (.*) s to decay", line)[1])
    assert 0.75 < memory < 1.05 / (3e-4 * 2 * np.pi * 100)


@pytest.mark.parametrize("structure", ["oscillator", "fractional"])
@pytest.mark.parametrize("natural_hz, ratio, samples", [
    (100.0, 3e-4, 1500), (100.0, 1.2e-4, 1500), (30.0, 1e-3, 1500), (10.0, 5e-3, 2000),
    (4.0, 0.05, 1200), (2.0, 0.02, 2000), (200.0, 2e-4, 1000)])
def test_sensor_that_rings_on_from_before_the_record(natural_hz, ratio, samples, structure):
    """Recorded in mid-motion, for less than the free motion takes to decay to 1/e."""
    rng = np.random.default_rng([20261201, samples])
    memory_s = 1 / (2 * np.pi * natural_hz * ratio)
    assert memory_s > samples / RATE_HZ
    excitation = rig.band_noise(rng, RATE_HZ, samples / RATE_HZ, (5.0, 600.0), X_ONLY,
                                lead_s=min(5 * memory_s, 20.0))
    _, reference, raw = measured(45, excitation, natural_frequency=(natural_hz / RATE_HZ,) * 2,
                                 damping_ratio=(ratio, ratio))
    with pytest.raises(IdentificationError, match="takes at least|still rings"):
        identify(Record.of(reference, raw), structure=structure)


@pytest.mark.parametrize("share", [-0.6, -0.3, 0.3, 0.6])
def test_delay_of_much_of_the_record(share, tmp_path, capsys):
    """Windows of one motion, `share` of their length apart, under the same stamps."""
    _, reference, raw = measured(41)
    shift = int(share * 2500)
    first, second = max(-shift, 0), max(shift, 0)
    stamps = reference.stamps_ns[:2500]
    line = refused(Samples.of(stamps, reference.values[first:first + 2500]),
                   Samples.of(stamps, raw.values[second:second + 2500]), tmp_path, capsys)
    assert "expected less than a quarter of it" in line
    found, word = re.search("the sensor is (.*) s (earlier|later)", line).groups()
    assert word == ("earlier" if shift > 0 else "later")
    assert float(found) == pytest.approx(abs(shift) / RATE_HZ, abs=0.01)


def test_parameters_that_are_only_determined_together():
    """Far below the resonance, delay and damping are one slope of the phase."""
    rng = np.random.default_rng(20261204)
    excitation = rig.band_noise(rng, RATE_HZ, 2.0, (5.0, 60.0), X_ONLY, lead_s=0.3)
    _, reference, raw = measured(50, excitation, snr_db=40, natural_frequency=(0.15, 0.15))
    note, = (note for note in run(reference, raw).notes if "only determined together" in note)
    assert "damping_ratio" in note and "delay_s" in note and "excitation from 6" in note
    _, reference, raw = measured(50, natural_frequency=(0.15, 0.15))
    assert not any("only determined together" in note for note in run(reference, raw).notes)


def test_excitation_is_reported(tmp_path, capsys):
    _, reference, raw = measured(60)
    write_bag(tmp_path / "b.mcap", {REFERENCE_TOPIC: reference, RAW_TOPIC: raw})
    assert main(["identify", str(tmp_path / "b.mcap"), "-o", str(tmp_path / "m.yaml"),
                 "--structure", "oscillator", "--json", str(tmp_path / "r.json")]) == 0
    check = json.loads((tmp_path / "r.json").read_text())["excitation"]
    x = reference.values[:, 0] - reference.values[:, 0].mean()
    assert check["rms"] == pytest.approx(np.std(x))
    assert check["crest_factor"] == pytest.approx(np.max(np.abs(x)) / np.std(x))
    assert check["order"] > check["needed"] == 4
    assert check["band_hz"][0] < 10 and 550 < check["band_hz"][1] < 650
    assert check["quietest_rms"] < check["rms"] < check["loudest_rms"]
    out = capsys.readouterr().out
    assert f"of order {check['order']} (at least 4 needed)" in out
    assert f"reference RMS {check['rms']:.4g} m/s^2" in out


@pytest.mark.parametrize("factor, words", [(1e200, "go up to"), (1e-200, "vary by")])
def test_values_beyond_any_unit(factor, words):
    _, reference, raw = measured(61)
    raw = raw._replace(values=raw.values * factor)
    with pytest.raises(IdentificationError, match=f"the sensor's values {words} .*corrupt"):
        run(reference, raw)


def test_lattice_step():
    rng = np.random.default_rng(20261205)
    lattice = 0.013 * rng.integers(-40, 40, 2000) + 0.7
    assert lattice_step(lattice) == pytest.approx(0.013)
    assert lattice_step(rng.normal(size=2000)) is None
    assert lattice_step(np.tile(rng.normal(size=20), 100)) is None
