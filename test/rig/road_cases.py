"""Cases on the road: cheap sensors in cars, with all that surrounds them there.

The surroundings are no fault to be found, and the model in use is not told of them: noise that is
coloured and stands on the reference too, spikes, a lattice of 0.01 g, topics at rates of their own,
lost messages, stamps that scatter. What of it has a name in the catalogue stands in the case's
`besides`: a diagnosis may name it.
"""

import dataclasses

import numpy as np

from .hidden import HiddenCase, draw_causes, draw_temperature, model_in_use
from .logger import Logger
from .record import simulate_record
from .road import draw_drive, drive_on_road, turned
from .scaling import Bench, draw_effects
from .sensor import CAUSES, SECOND_SET, UNCATALOGUED, Sensor
from .unknown import partly_true

G = 9.80665  # m/s²
LATTICE = 0.01 * G  # as phones and cheap sensors have it

# A flat sensor has no spring that could have these.
OF_A_SPRING = {
    "core_parameter_shift", "fractional_damping", "quadratic_stiffness", "cubic_stiffness",
    "hysteresis", "coulomb_friction", "stiffness_drift", "quadratic_damping", "impact_stop"}
ROAD_CAUSES = tuple(cause for cause in (*CAUSES, *SECOND_SET) if cause not in OF_A_SPRING)
ROAD_VARIANTS = ("turned_axes", "late_stamps")

# With gravity on the axis they would be something else, or take minutes to settle.
NOT_UNDER_GRAVITY = {
    "dead_zone", "backlash", "ac_coupling", "reference_ac_coupling", "asymmetric_gain",
    "tanh_saturation", "rectification_memory", "slew_limit", "duffing_mount", "wrong_model",
    "mounting_resonance", "second_resonance"}
FILTERS = {"low_pass_lag", "low_pass_filter", "linear_phase_filter", "time_delay"}
# Whole records' courses, for which a beginning in mid-record has no sense.
FROM_THE_START = {"batched_stamps", "wrong_model"}


@dataclasses.dataclass(frozen=True)
class Surroundings:
    """What the road and the network add.

    Attributes
    ----------
    snr_db, reference_snr_db : float
        Of the sensor's and of the reference's noise below the motion.
    noise_ar : tuple of float
        Colour of the sensor's noise.
    spikes : tuple of float or None
        Share, and size over the noise.
    lattice : bool
    logger : Logger
    lost, jitter : float
        Share of lost sensor messages; scatter of its stamps in intervals.
    skew_ppm : float
        Of the sensor's clock.
    """

    snr_db: float
    reference_snr_db: float
    noise_ar: tuple
    spikes: tuple | None
    lattice: bool
    logger: Logger
    lost: float
    jitter: float
    skew_ppm: float


def draw_road_causes(seed, count):
    """`count` different causes that a sensor in a car may have and that can be told apart."""
    return draw_causes(seed, count, ROAD_CAUSES)


def draw_road_case(seed, causes=(), duration_s=None, times_noise=None):
    """Random case on the road.

    Parameters
    ----------
    seed : int
    causes : iterable of str
        Of `ROAD_CAUSES`, `ROAD_VARIANTS` and `UNCATALOGUED`; none for a sensor as modelled.
    duration_s : float, optional
        Default: one to ten minutes, drawn.
    times_noise : float, optional
        As in `hidden.draw_case`.

    Returns
    -------
    HiddenCase
    """
    causes = set(causes)
    rng = np.random.default_rng([seed, 8608, *sorted(map(ord, "".join(sorted(causes))))])
    for _ in range(60):
        case = _draw(rng, seed, causes, duration_s, times_noise)
        if case is not None:
            return case
    raise RuntimeError(f"seed {seed}, {sorted(causes)}: no draw has effects of the wanted size")


def _draw(rng, seed, causes, duration_s, times_noise):
    rate_hz = float(rng.choice([100.0, 200.0, 400.0]))
    length_s = float(rng.choice([60, 90, 120, 180, 300, 600], p=[0.3, 0.2, 0.2, 0.15, 0.1, 0.05]))
    around = _draw_surroundings(rng, causes, rate_hz)
    drive, excitation = _draw_motion(rng, causes, rate_hz, duration_s or length_s, around.logger)
    core, known = _draw_sensor(rng, causes, rate_hz)
    times = around.logger.reference_times(excitation)
    bench = Bench(core, excitation, draw_temperature(rng, len(times)), logger=around.logger,
                  surroundings=known)
    sensor_noise = bench.clean.std() * 10 ** (-around.snr_db / 20)
    reference_noise = excitation.reference[:, 0].std() * 10 ** (-around.reference_snr_db / 20)
    besides = _besides(around, core, rate_hz, reference_noise)
    lattice = besides.get("quantization", {"step": 0.0})["step"]
    bench.noise_std = float(np.sqrt(sensor_noise ** 2 + lattice ** 2 / 12
                                    + (bench.noise_gain * reference_noise) ** 2))
    drawn = draw_effects(rng, bench, causes, times_noise)
    if drawn is None:
        return None
    effects, alone = drawn
    for kind in set(effects) & set(UNCATALOGUED) - FROM_THE_START:
        if rng.random() < 0.3:  # a fault that begins in mid-record
            share = rng.uniform(0.3, 0.7)
            effects[kind] = {**effects[kind], "begins_s": float(share * times[-1])}
            alone[kind] *= float(np.sqrt(1 - share))
    sensor = Sensor(core, {**besides, **known, **effects})
    try:
        record = simulate_record(
            sensor, excitation, rng, noise_std=sensor_noise, noise_ar=around.noise_ar,
            temperature_c=bench.temperature_c, logger=around.logger,
            spikes=around.spikes and (around.spikes[0], around.spikes[1] * sensor_noise))
    except FloatingPointError:
        return None
    besides = {**partly_true(effects), **besides}
    if around.spikes:
        besides["interference_bursts"] = {}  # short and strong, whatever they are called
    baseline = model_in_use(core, effects)
    baseline = Sensor(core, {**known, **baseline.effects})
    needs = {"temperature_sensitivity", "thermal_offset"} & set(effects)
    return HiddenCase(record, sensor, baseline, set(effects), effects, bench.noise_std, alone,
                      core["type"], f"road_{drive.road_class}", seed,
                      bool(needs) or bool(rng.integers(2)), besides)


def _draw_surroundings(rng, causes, rate_hz):
    """The same faults are not there twice: what is hidden is not part of the surroundings."""
    network = str(rng.choice(["bench", "phone", "can"], p=[0.4, 0.3, 0.3]))
    logger, lost, jitter, skew_ppm = Logger(), 0.0, 0.0, 0.0
    if network == "phone":
        logger = Logger(sensor_rate_hz=float(rate_hz * rng.uniform(0.9, 1.1)),
                        sensor_start_s=float(rng.uniform(0, 1) / rate_hz))
        lost, jitter = float(rng.choice([0.0, 0.003, 0.01])), float(rng.uniform(0, 0.05))
        skew_ppm = float(rng.choice([0.0, rng.uniform(-40, 40)]))
    elif network == "can":
        logger = Logger(reference_rate_hz=float(rng.choice([50.0, 100.0])),
                        reference_lost=float(rng.choice([0.0, 0.005])))
    colour = float(rng.uniform(0.3, 0.9)) if rng.random() < 0.3 else None
    spikes = (10 ** rng.uniform(-4, -3), rng.uniform(8, 40)) if rng.random() < 0.15 else None
    noisy_reference = rng.uniform(20, 40) if rng.random() < 0.5 else rng.uniform(50, 70)
    around = Surroundings(
        snr_db=float(rng.uniform(30, 60)), reference_snr_db=float(noisy_reference),
        noise_ar=() if colour is None else (colour,), spikes=spikes,
        lattice=bool(rng.random() < 0.4), logger=logger, lost=lost, jitter=jitter,
        skew_ppm=skew_ppm)
    quiet = {"reference_noise": {"reference_snr_db": np.inf}, "quantization": {"lattice": False},
             "interference_bursts": {"spikes": None}, "dropped_samples": {"lost": 0.0},
             "timestamp_jitter": {"jitter": 0.0}, "sampling_jitter": {"jitter": 0.0},
             "polled_readout": {"jitter": 0.0},
             "clock_skew": {"skew_ppm": 0.0}, "time_step": {"skew_ppm": 0.0},
             "held_values": {"lost": 0.0}, "batched_stamps": {"lost": 0.0, "jitter": 0.0}}
    for cause in causes & set(quiet):
        around = dataclasses.replace(around, **quiet[cause])
    return around


def _draw_motion(rng, causes, rate_hz, duration_s, logger):
    """Drive and motion in the sensor's axes; x is upright in half of the cars."""
    drive = draw_drive(rng)
    order = str(rng.choice(["zxy", "xyz", "yzx"], p=[0.5, 0.25, 0.25]))
    if order[0] == "z" and causes & NOT_UNDER_GRAVITY:
        drive = dataclasses.replace(drive, gravity=False)
    slowest = min(rate_hz, logger.reference_rate_hz or rate_hz, logger.sensor_rate_hz or rate_hz)
    band_hz = (0.5, min(40.0, 0.4 * slowest))
    return drive, turned(drive_on_road(rng, rate_hz, duration_s, drive, band_hz), order)


def _draw_sensor(rng, causes, rate_hz):
    """A flat core, or in a fifth of the draws an adhesive pad's resonance above the band.

    A digital filter that the data sheet states is known to the model in use.
    """
    core = {"type": "gain", "sensitivity": float(rng.uniform(0.9, 1.1))}
    if rng.random() < 0.2:
        core = {"type": "oscillator", "natural_frequency_hz": float(rng.uniform(45, 120)),
                "damping_ratio": float(rng.uniform(0.1, 0.8)), "damping_order": 1.0,
                "sensitivity": core["sensitivity"]}
    known = {}
    if not causes & FILTERS and rng.random() < 0.25:
        if rng.integers(2):
            known["low_pass_filter"] = {
                "corner_hz": float(rate_hz * rng.uniform(0.15, 0.45)),
                "order": int(rng.integers(2, 5)), "family": "butterworth"}
        else:
            known["linear_phase_filter"] = {"length_s": float(rng.uniform(0.5, 3) / rate_hz),
                                            "order": int(rng.integers(1, 4))}
    return core, known


def _besides(around, core, rate_hz, reference_noise):
    """What of the surroundings has a name in the catalogue, with its parameters."""
    besides = {}
    if reference_noise:
        besides["reference_noise"] = {"std": float(reference_noise)}
    if around.lattice:
        besides["quantization"] = {"step": LATTICE * core["sensitivity"]}
    if around.lost:
        besides["dropped_samples"] = {"fraction": around.lost}
    if around.jitter:
        besides["timestamp_jitter"] = {"rms_s": around.jitter / rate_hz}
    if around.skew_ppm:
        besides["clock_skew"] = {"skew_ppm": around.skew_ppm}
    return besides
