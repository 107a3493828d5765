"""`identify` finds a classical sensor's parameters, and says how well the data determine them."""

import numpy as np
import pytest
import rig

from frac_accel import FracAccelError, SensorModel, identify
from frac_accel.errors import IdentificationError
from frac_accel.io.samples import Samples
from frac_accel.record import Record

RATE_HZ = 2000.0
PARAMETERS = ("sensitivity", "natural_frequency_hz", "damping_ratio", "delay_s")


def measured(rng, snr_db=20.0, duration_s=5.0, band_hz=(5.0, 700.0), noise_ar=(), **draw):
    """A random classical sensor and the pair that a bench would record of it, in mid-motion."""
    sensor = rig.draw_sensor(rng, RATE_HZ, "classical", ["time_delay"], **draw)
    excitation = rig.band_noise(rng, RATE_HZ, duration_s, band_hz, (1.0, 0.0, 0.0), lead_s=1.0)
    record = rig.simulate_record(sensor, excitation, rng, snr_db=snr_db, noise_ar=noise_ar)
    return sensor, record


def pair_of(record, **changes):
    reference = Samples.of(record.stamps_ns, record.reference)
    sensor = Samples.of(record.sensor_stamps_ns, record.sensor)
    return Record.of(reference, sensor, **changes)


def truth(sensor):
    return np.array([sensor.core["sensitivity"], sensor.core["natural_frequency_hz"],
                     sensor.core["damping_ratio"], sensor.effects["time_delay"]["delay_s"]])


@pytest.mark.parametrize("noise_ar", [(), (0.9,)], ids=["white", "coloured"])
def test_intervals_cover_the_truth(noise_ar):
    rng = np.random.default_rng(20261)
    scores = []
    for _ in range(20):
        sensor, record = measured(rng, noise_ar=noise_ar)
        result = identify(pair_of(record), structure="oscillator")
        values = np.array([result.parameters[name]["value"] for name in PARAMETERS])
        std = np.array([result.parameters[name]["std"] for name in PARAMETERS])
        scores.append((values - truth(sensor)) / std)
    covered = np.mean(np.abs(scores) < 1.96)
    # 80 correlated trials of 0.95: below 0.87 has a probability of about 1 %
    assert covered >= 0.87
    assert np.sqrt(np.mean(np.square(scores))) < 1.35


def test_parameters_are_close_at_40_db():
    rng = np.random.default_rng(20262)
    errors = []
    for _ in range(8):
        sensor, record = measured(rng, snr_db=40.0)
        result = identify(pair_of(record), structure="oscillator")
        values = np.array([result.parameters[name]["value"] for name in PARAMETERS])
        errors.append(np.abs(values / truth(sensor) - 1))
    assert np.all(np.median(errors, axis=0) < [1e-3, 1e-3, 3e-3, 3e-3])


def test_shock_record():
    rng = np.random.default_rng(20263)
    core = {"type": "oscillator", "natural_frequency_hz": 40e3, "damping_ratio": 0.02,
            "damping_order": 1.0, "sensitivity": 0.227}
    sensor = rig.Sensor(core, {"time_delay": {"delay_s": 2e-6}})
    excitation = rig.shock(1e6, 0.01, 40e-6, amplitude=(8e4, 0.0, 0.0))
    record = rig.simulate_record(sensor, excitation, rng, snr_db=50)
    result = identify(pair_of(record), structure="oscillator")
    assert result.parameters["sensitivity"]["value"] == pytest.approx(0.227, rel=2e-3)
    assert result.parameters["natural_frequency_hz"]["value"] == pytest.approx(40e3, rel=0.02)


def test_model_round_trip(tmp_path):
    _, record = measured(np.random.default_rng(20264))
    result = identify(pair_of(record), structure="oscillator", provenance={"bag": "a.mcap"})
    result.model.save(tmp_path / "m.yaml")
    model = SensorModel.load(tmp_path / "m.yaml")
    assert model.to_dict() == result.model.to_dict()
    assert model.metadata["uncertainties"]["natural_frequency_hz"]["unit"] == "Hz"
    assert np.shape(model.metadata["covariance"]["matrix"]) == (5, 5)
    provenance = model.metadata["provenance"]
    assert (provenance["axis"], provenance["structure"], provenance["bag"]) == \
        ("x", "oscillator", "a.mcap")
    low, high = model.band_hz
    assert low < 20 and 600 < high < 750
    assert model.noise_std == pytest.approx(record.noise_std[0], rel=0.1)


def test_lag_between_the_topics_is_no_delay_of_the_sensor():
    sensor, record = measured(np.random.default_rng(20265), snr_db=60)
    late = int(0.3e9 / RATE_HZ)
    reference = Samples.of(record.stamps_ns, record.reference)
    shifted = Samples.of(record.sensor_stamps_ns + late, record.sensor)
    result = identify(Record.of(reference, shifted), structure="oscillator")
    delay = result.parameters["delay_s"]["value"]
    assert delay == pytest.approx(sensor.effects["time_delay"]["delay_s"] + late * 1e-9, abs=2e-6)


def test_missing_samples_do_not_count():
    rng = np.random.default_rng(20266)
    sensor, record = measured(rng, snr_db=60)
    keep = rng.random(len(record.sensor)) > 0.05
    reference = Samples.of(record.stamps_ns, record.reference)
    holed = Samples.of(record.sensor_stamps_ns[keep], record.sensor[keep])
    result = identify(Record.of(reference, holed), structure="oscillator")
    values = np.array([result.parameters[name]["value"] for name in PARAMETERS])
    assert np.all(np.abs(values / truth(sensor) - 1) < [2e-3, 2e-3, 5e-3, 5e-3])
    assert any("have no sample" in note for note in result.notes)


def test_one_sine_is_refused():
    """Persistently exciting of order 2: four parameters need two sines at least."""
    rng = np.random.default_rng(20267)
    sensor = rig.draw_sensor(rng, RATE_HZ, "classical")
    excitation = rig.sines(RATE_HZ, 4.0, [300.0], [0.0], (1.0, 0.0, 0.0), lead_s=1.0)
    record = rig.simulate_record(sensor, excitation, rng, snr_db=60)
    with pytest.raises(IdentificationError, match="only 300 Hz: .* order 2, .* at least 2 freq"):
        identify(pair_of(record))


def test_open_parameters_are_named():
    """A resonance 50 times above the excitation leaves its frequency and damping open."""
    rng = np.random.default_rng(20268)
    _, record = measured(rng, snr_db=20.0, band_hz=(1.0, 12.0), natural_frequency=(0.3, 0.3))
    notes = " ".join(identify(pair_of(record), structure="oscillator").notes)
    assert "natural_frequency_hz is not determined" in notes
    assert "damping_ratio is not determined" in notes


def test_unrelated_signals_are_refused():
    rng = np.random.default_rng(20269)
    stamps = np.arange(8000) * 500_000
    first, second = (Samples.of(stamps, rng.standard_normal((8000, 3))) for _ in range(2))
    with pytest.raises(IdentificationError, match="nothing to do with the reference"):
        identify(Record.of(first, second))


def test_what_the_model_lacks_is_said():
    rng = np.random.default_rng(20270)
    sensor = rig.draw_sensor(rng, RATE_HZ, "fractional", damping_order=(0.45, 0.55),
                             damping_ratio=(0.3, 0.5), natural_frequency=(0.08, 0.15))
    excitation = rig.band_noise(rng, RATE_HZ, 5.0, (5.0, 700.0), (1.0, 0.0, 0.0), lead_s=1.0)
    record = rig.simulate_record(sensor, excitation, rng, snr_db=60)
    result = identify(pair_of(record), structure="oscillator")
    assert result.held_out_nrmse > 0.01
    assert "a better model could explain a further" in result.validation.verdict[0]


STAMPS = np.arange(100) * 1_000_000
VALUES = np.random.default_rng(0).standard_normal((100, 3))


@pytest.mark.parametrize("reference, sensor, words", [
    (Samples.of(STAMPS, VALUES), Samples.of(STAMPS * 2, VALUES), "instants in common are left at"),
    (Samples.of(STAMPS, VALUES), Samples.of(STAMPS + 10**9, VALUES[::-1]), "no time in common"),
    (Samples.of(STAMPS, VALUES), Samples.of(STAMPS, 0 * VALUES), "sensor: axis x is constant at 0"),
    (Samples.of(STAMPS, VALUES * [0, 1, 0]), Samples.of(STAMPS, VALUES), "there is signal on y"),
    (Samples.of(STAMPS[:1], VALUES[:1]), Samples.of(STAMPS, VALUES), "reference: 1 usable sample"),
    (Samples.of(0 * STAMPS, VALUES), Samples.of(STAMPS, VALUES), "whose stamps advance"),
    (Samples.of(STAMPS, VALUES), Samples.of(STAMPS, VALUES * np.nan), "whose values are finite"),
])
def test_bad_pairs_are_refused(reference, sensor, words):
    with pytest.raises(FracAccelError, match=words):
        Record.of(reference, sensor)
