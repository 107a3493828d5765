"""Do the 95 % intervals of `identify` cover the truth, how far off is it, what does auto choose?

    OPENBLAS_NUM_THREADS=1 PYTHONPATH=.:test python benchmarks/identification_monte_carlo.py

Sensors are drawn at random, their records made by the independent simulator in test/rig: 5 s at
2 kHz of noise from 5 to 700 Hz, recorded in mid-motion, with white noise or AR(0.9). Runs in which
a parameter is not determined, as the model's notes say, are counted apart: linear intervals hold
nothing there.
"""

import argparse

import numpy as np
import rig
import scipy.signal
import scipy.stats

from frac_accel import identify
from frac_accel.record import Record

RATE_HZ, DURATION_S = 2000.0, 5.0
# kinds of sensors that each structure is identified from
KINDS = {"oscillator": ("classical",), "fractional": ("fractional",),
         "fractional_transfer_function": ("fractional_transfer_function",),
         "arx": ("arx", "classical")}
COLOURS = {"white": (), "AR(0.9)": (0.9,)}
S = 2j * np.pi * np.geomspace(10, 600, 50)


def clean_record(rng, kind):
    """A random sensor, the reference and the sensor's output without noise."""
    # no transfer function in z has a fraction of a sample of delay
    effects = ["offset"] if kind == "arx" else ["time_delay", "offset"]
    sensor = rig.draw_sensor(rng, RATE_HZ, kind, effects)
    excitation = rig.band_noise(rng, RATE_HZ, DURATION_S, (5.0, 700.0), (1.0, 0.0, 0.0), lead_s=1.0)
    record = rig.simulate_record(sensor, excitation)
    return sensor, record.reference, record.clean


def noisy_pair(rng, reference, clean, snr_db, noise_ar):
    """The pair with noise of a level below the signal's standard deviation."""
    noise = rng.normal(size=len(clean) + 1000)
    noise = scipy.signal.lfilter([1.0], np.r_[1.0, -np.asarray(noise_ar)], noise)[1000:]
    sensor = clean.copy()
    sensor[:, 0] += noise / noise.std() * clean[:, 0].std() * 10**(-snr_db / 20)
    return Record(RATE_HZ, reference, sensor, np.ones(len(clean), bool), 0.0, 0, np.nan)


def parameter_scores(result, sensor):
    """Errors over standard uncertainties, and relative errors, by parameter."""
    truth = {**sensor.core, **sensor.effects["time_delay"], **sensor.effects["offset"]}
    errors = {name: (entry["value"] - truth[name], entry["std"], truth[name])
              for name, entry in result.parameters.items()}
    return ({name: abs(error / std) for name, (error, std, _) in errors.items()},
            {name: abs(error / value) for name, (error, _, value) in errors.items()})


def response_scores(result, sensor):
    """The same of amplitude and phase over the band, from the parameters' covariance."""
    names = list(result.parameters)
    values = np.array([result.parameters[name]["value"] for name in names])
    covariance = np.array(result.model.metadata["covariance"]["matrix"])
    response_of = rational_response if result.structure == "arx" else general_response
    response = response_of(dict(zip(names, values)))
    slopes = []
    for place, value in enumerate(values):
        step = 1e-5 * max(abs(value), 1e-6)
        moved = np.where(np.arange(len(values)) == place, values + step, values)
        slopes.append((response_of(dict(zip(names, moved))) / response - 1) / step)
    slopes = np.array(slopes)
    error = np.log(response / rig.transfer_function(sensor, "x", S))
    scores, errors = {}, {}
    for name, part in (("amplitude", np.real), ("phase", np.imag)):
        variance = np.einsum("if,ij,jf->f", part(slopes), covariance, part(slopes))
        scores[name] = np.abs(part(error)) / np.sqrt(np.maximum(variance, 1e-300))
        errors[name] = np.sqrt(np.mean(part(error)**2))
    return scores, errors


def general_response(values):
    """Response at `S` of the general equation with these parameters, offset left out."""
    u = S / (2 * np.pi * values["natural_frequency_hz"])
    slope = values.get("slope_ratio", 0.0) * u**values.get("slope_order", 0.0)
    return (values["sensitivity"] * (1 + slope) * np.exp(-S * values["delay_s"])
            / (u**values["inertia_order"]
               + 2 * values["damping_ratio"] * u**values["damping_order"] + 1))


def rational_response(values):
    """Response at `S` of a transfer function in z."""
    back = np.exp(-S / RATE_HZ)
    a, b = ([value for name, value in values.items() if name[0] == letter and name[1:].isdigit()]
            for letter in "ab")
    return (np.exp(-S * values["delay_s"]) * np.polyval(b[::-1], back)
            / np.polyval([*a[::-1], 1.0], back))


def pole_scores(result, sensor):
    """Natural frequency and damping ratio in s, for a model with one pair of poles."""
    pairs = result.model.metadata["continuous_equivalent"]["poles"]
    if len(pairs) != 1 or "a3" in result.parameters:
        return {}, {}
    truth = sensor.core
    if truth["type"] == "arx":
        pole = RATE_HZ * np.log(np.roots(truth["denominator"])[0] + 0j)
        truth = {"natural_frequency_hz": abs(pole) / (2 * np.pi),
                 "damping_ratio": -pole.real / abs(pole)}
    errors = {name: (entry["value"] - truth[name], entry["std"], truth[name])
              for name, entry in pairs[0].items()}
    return ({name: abs(error / std) for name, (error, std, _) in errors.items()},
            {name: abs(error / value) for name, (error, _, value) in errors.items()})


def scores_of(result, sensor):
    """Errors over standard uncertainties and relative errors by name; None if not determined."""
    if result.structure == "fractional_transfer_function":
        # undetermined parameters may well determine the response
        return response_scores(result, sensor)
    if result.structure == "arx":
        return tuple({**whole, **poles} for whole, poles in
                     zip(response_scores(result, sensor), pole_scores(result, sensor)))
    if any("not determined" in note for note in result.notes):
        return None
    return parameter_scores(result, sensor)


def coverage(structure, kind, runs, seed, snrs_db):
    """One row for each colour and level of the noise."""
    table = {}
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        sensor, reference, clean = clean_record(rng, kind)
        for colour, noise_ar in COLOURS.items():
            for snr_db in snrs_db:
                pair = noisy_pair(rng, reference, clean, snr_db, noise_ar)
                table.setdefault((colour, snr_db), []).append(
                    scores_of(identify(pair, structure=structure), sensor))
    for (colour, snr_db), entries in table.items():
        determined = [entry for entry in entries if entry is not None]
        low, high = scipy.stats.binom.interval(0.95, len(determined), 0.95)
        print(f"{structure} of {kind} sensors, {colour}, {snr_db:g} dB: {len(determined)} of "
              f"{runs} runs determined; a true 95 % gives {low / len(determined):.3f} to "
              f"{high / len(determined):.3f}")
        for name in dict.fromkeys(name for entry in determined for name in entry[0]):
            known = [entry for entry in determined if name in entry[0]]
            scores = np.concatenate([np.atleast_1d(entry[0][name]) for entry in known])
            errors = [entry[1][name] for entry in known]
            print(f"  {name:22} covered {np.mean(scores < 1.96):.3f}  median relative error "
                  f"{np.median(errors):.2g}  ({len(known)} runs)", flush=True)


def choices(runs, seed, snrs_db):
    """What auto makes of classical and of fractional sensors."""
    for kind in ("classical", "fractional"):
        chosen = {}
        for run in range(runs):
            rng = np.random.default_rng([seed, 1, run])
            _, reference, clean = clean_record(rng, kind)
            for colour, noise_ar in COLOURS.items():
                for snr_db in snrs_db:
                    pair = noisy_pair(rng, reference, clean, snr_db, noise_ar)
                    chosen.setdefault((colour, snr_db), []).append(identify(pair).structure)
        for (colour, snr_db), structures in chosen.items():
            print(f"auto, {kind} sensor, {colour}, {snr_db:g} dB: fractional in "
                  f"{structures.count('fractional')} of {runs} runs", flush=True)


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", nargs="*", default=[*KINDS, "auto"], help=", ".join(KINDS)
                        + " or auto (default: all)")
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=50261)
    parser.add_argument("--snr", type=float, nargs="+", default=[20.0, 40.0, 60.0], metavar="DB")
    arguments = parser.parse_args()
    for what in arguments.what:
        if what == "auto":
            choices(arguments.runs, arguments.seed, arguments.snr)
        else:
            for kind in KINDS[what]:
                coverage(what, kind, arguments.runs, arguments.seed, arguments.snr)


if __name__ == "__main__":
    main()
