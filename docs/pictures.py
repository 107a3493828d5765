"""Pictures of the site: what each cause leaves of a simulation that does not know it.

Each is a record of the independent simulator in test/rig with that cause alone hidden in it, on a
sensor and a motion drawn at random, a hundred times as strong as the noise.
"""

from pathlib import Path

import numpy as np
import rig.hidden
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from rig.sensor import CAUSES, SECOND_SET
from scipy.signal import butter, sosfiltfilt

from frac_accel import Record, SensorModel, simulate
from frac_accel.model.effects import known_effects
from frac_accel.shown import above, plain_logarithms
from frac_accel.signals.averaged_spectra import power_of, segment_spectra
from frac_accel.signals.metrics import interpolate

DRAWN = (*CAUSES, *SECOND_SET)
_TIMES_NOISE = 100.0
_SEED = 11
# Samples that are shown one by one, and those of a spectrum's segments.
_SHOWN, _SEGMENT = 150, 1024
_INTRODUCTION = """# Causes, one by one

What each cause leaves of a simulation that does not know it. Left: the measured output and that of
the model in use, where the motion is strongest. Middle: what is left, by the size of the output.
Right: its spectrum beside the output's. The records come from the independent simulator of the
tests, one cause in each, on a sensor and a motion drawn at random.
[The table](../effects.md) has all parameters; [own_cause](../own_cause.md) says how to add one.
"""
# What that simulator has not: model of the sensor; the model in use is its core alone.
_OWN = {"free_mass_friction": {
    "schema": "frac_accel/sensor_model/1", "core": {"type": "gain", "sensitivity": 1.0},
    "effects": [{"cause": "free_mass_friction", "corner_hz": 1.0, "level": 0.1}]}}


def make(folder):
    """Write the page of the causes and its pictures, unless they are newer than what they show.

    Parameters
    ----------
    folder : Path
    """
    folder.mkdir(exist_ok=True)
    page = [_INTRODUCTION]
    for cause, effect in sorted(known_effects().items()):
        page.append(f"## {cause}\n\n{effect.explanation}\n")
        if cause in (*DRAWN, *_OWN):
            picture = folder / f"{cause}.png"
            if not _is_new(picture):
                draw(cause).savefig(picture, dpi=90)
            page.append(f"![{cause}]({cause}.png)\n")
        page.append(f"To confirm it: {effect.experiment}\n")
    (folder / "causes.md").write_text("\n".join(page), encoding="utf-8")


def draw(cause, seed=_SEED):
    """Picture of one cause, as a matplotlib Figure."""
    if cause in _OWN:
        measured, simulated, rate = _simulated(_OWN[cause], seed)
    else:
        measured, simulated, rate = _compared(rig.hidden.draw_case(
            seed, [cause], kind="dongle", excitation="band_noise", times_noise=_TIMES_NOISE))
    left = measured - simulated
    figure = Figure(figsize=(11, 3.2), layout="constrained")
    signals, sizes, spectra = figure.subplots(1, 3)
    start = int(np.argmax(np.convolve(measured**2, np.ones(_SHOWN), "valid")))
    part = slice(start, start + _SHOWN)
    time_ms = 1e3 * np.arange(_SHOWN) / rate
    signals.plot(time_ms, measured[part], color="#8a919a", lw=2.5, label="measured")
    signals.plot(time_ms, simulated[part], color="#2f86c9", lw=1, label="model in use")
    signals.plot(time_ms, left[part], color="#d9772b", lw=1, label="what is left")
    above(signals)
    signals.set(xlabel="time [ms]", ylabel="output")
    sizes.plot(simulated, left, ".", ms=1, alpha=0.3, color="#d9772b", rasterized=True)
    sizes.set(xlabel="model in use", ylabel="what is left")
    frequency = np.fft.rfftfreq(_SEGMENT, 1 / rate)[1:]
    for values, colour in ((measured, "#8a919a"), (left, "#d9772b")):
        density = np.sqrt(power_of(segment_spectra(values, "hann", _SEGMENT)) / rate)[1:]
        spectra.loglog(frequency, density, color=colour, lw=1)
    spectra.set(xlabel="frequency [Hz]", ylabel="density [output units/√Hz]")
    plain_logarithms(spectra)
    # 100, 200, 500 and 1000 have no room beside each other
    spectra.xaxis.set_major_locator(LogLocator())
    return figure


def _compared(case):
    """Measured and simulated output of axis x at the same instants, and their rate [Hz]."""
    reference, sensor, _ = case.samples()
    pair = Record.of(reference, sensor, "x")
    simulated = simulate(case.model(), pair.reference, pair.sampling_rate_hz, initial="steady")
    instants = np.round(1e9 * np.arange(len(pair)) / pair.sampling_rate_hz).astype(np.int64)
    shifted = interpolate(instants, simulated, instants + round(1e9 * pair.lag_s),
                          pair.sampling_rate_hz)[:, 0]
    good = np.isfinite(shifted) & pair.valid
    # instants without a sample are left out: here nothing hangs on their number
    return pair.sensor[good, 0], shifted[good], pair.sampling_rate_hz


def _simulated(model, seed, rate=500.0, samples=10_000):
    """The same by the package's own simulation, of noise up to a tenth of the rate."""
    model = SensorModel.from_dict(model)
    motion = sosfiltfilt(butter(4, 0.2, output="sos"),
                         np.random.default_rng(seed).normal(size=samples))
    return (simulate(model, motion, rate, "x", initial="steady"),
            simulate(SensorModel(model.core), motion, rate, "x", initial="steady"), rate)


def _is_new(picture):
    """Whether a picture is newer than its cause, the simulator and this file."""
    if not picture.exists():
        return False
    folder = Path(rig.hidden.__file__).parent
    causes = Path(known_effects.__code__.co_filename).parent
    sources = [Path(__file__), causes / f"{picture.stem}.py", *folder.glob("*.py")]
    made = picture.stat().st_mtime
    return all(source.stat().st_mtime < made for source in sources if source.exists())
