"""What the rules of doubt share: a fit's filters, and what is left of their kind."""

import numpy as np
from scipy.ndimage import uniform_filter1d

from ...model import is_link
from ..search import acts_as_filter

# Share of the motion's power below its highest frequency, and parts of the spectrum over which a
# density is taken.
_MOTION, _BANDS = 0.99, 200
# Share of what is left that its linear part surely must have to count, and from which a part is
# most of it.
_SURELY, MOSTLY = 0.03, 0.5
# Times the RMS of the linear part that is left which what is linear must take, or it may only
# resemble the true response. Likewise what changes with time.
RESEMBLES = 30.0
# Damping ratio of a pole below which a link shows as a resonance, and above which a mode beside the
# sensor's own hardly rings; and below which a peak is no smooth filter's.
_RESONANT, RINGS, CLEAR_PEAK = 0.19, 0.3, 0.2
# Share of a lead by which the lag of what undoes it may differ.
AS_LATE = 0.05


def filters_of(engine, best):
    """Causes that act as linear filters, by cause."""
    return {cause: effect for cause, effect in best.effects.items()
            if cause not in engine.search.base and acts_as_filter(effect)}


def share_of(engine, fitted, part):
    """Share of what a fit leaves that is of one part; 0 where that is noise."""
    return {name: share for share, name in engine.structure(fitted)}.get(part, 0.0)


def linear_share(engine, fitted):
    """Share of what a fit leaves that a linear filter would take: be it little, where more shows
    that this is no noise; 0 where it is."""
    part = next((entry for entry in engine.budget(fitted).parts if entry["part"] == "linear"), None)
    return part["share"] if part and engine.structure(fitted) and part["ci95"][0] > _SURELY \
        else share_of(engine, fitted, "linear")


def highest_hz(engine, best, share=_MOTION):
    """Frequency [Hz] below which nearly all of the motion is that the sensor shows."""
    used = engine.problem.used
    energy = np.cumsum(power_of(engine.problem, best.output - best.output[used].mean()))
    return np.searchsorted(energy, share * energy[-1]) * engine.problem.rate / len(used)


def highest_seen_hz(engine, best):
    """Frequency [Hz] up to which the motion that the sensor shows stands out of what is left."""
    p = engine.problem

    def density(values):
        power = power_of(p, values - values[p.used].mean())
        return uniform_filter1d(power, max(len(power) // _BANDS, 1), mode="reflect")
    left, frequency = density(best.residual), np.fft.rfftfreq(len(p.used), 1 / p.rate)
    seen = (density(best.output) > np.maximum(left, left.mean())) \
        & (frequency <= (p.record.band_hz or p.rate))
    return frequency[seen].max(initial=0.0)


def power_of(problem, values):
    """Power of values by the frequencies of `numpy.fft.rfft`, where samples count."""
    return np.abs(np.fft.rfft(values * problem.used))**2


def end_of_band_hz(problem):
    """Highest frequency [Hz] that is compared."""
    return problem.record.band_hz or problem.rate / 2


def core_is_identified(engine):
    """Whether nobody has stated the sensor's own core: it was identified from the record itself."""
    return any(entry.effect.restates_core and not entry.is_known
               for entry in engine.loose.values())


def own_delay_s(core):
    """Delay [s] of slow motion in an oscillator, 2 zeta / omega_0."""
    return core.damping_ratio / (np.pi * core.natural_frequency_hz)


def lag_s_at(effect, omega):
    """Time [s] by which motion of an angular frequency [rad/s] is late behind an effect."""
    turn = np.angle(effect.transfer_function(np.array([1j * omega]))[0]) if is_link(effect) else 0.0
    return effect.pure_delay_s() - float(turn) / omega


def largest_damping(effect):
    """Largest damping ratio of a link's poles: 1 of a real one; 0 without any."""
    poles = np.atleast_1d(effect.poles())
    ratios = np.where(poles.imag == 0, 1.0, -poles.real / np.maximum(np.abs(poles), 1e-300))
    return float(np.max(ratios, initial=0.0))


def is_smooth(link):
    """Whether a link has no resonance that would tell it."""
    poles = np.atleast_1d(link.poles())
    return not np.any(np.abs(poles.real) < _RESONANT * np.abs(poles))
