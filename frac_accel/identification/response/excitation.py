"""What the reference can tell: whether it excites enough to identify a model, and in which band."""

import dataclasses

import numpy as np
from scipy.fft import rfft
from scipy.ndimage import uniform_filter1d

from ...errors import IdentificationError
from ...signals.averaged_spectra import coherence_of, power_of, segment_spectra
from .recognise import recognise

# Power of a line or band, of the strongest, below which it is not excitation but noise or leakage.
_FLOOR = 1e-4
# Bins over which the window (its side lobes are 92 dB down) spreads a pure line.
_LINE_BINS = 8
# Order below which averaged segments may only be too short to tell lines apart, and the kinds of
# excitation that have few.
_FEW, _OF_SINES = 8, ("sine", "stepped_sine")
# Share of the reference's energy that a held-out check learns from; RMS of the rest, over that of
# the former, below which it is too quiet for a judgement, and share of the samples below which it
# is too few; stretches of which every other is then held out.
_LEARN, _QUIET_END, _FEW_SAMPLES, STRETCHES = 0.6, 0.5, 0.05, 20
# Energy of a frequency before, over that after, below which it is new there; share of new energy
# from which the record is a sweep; stretches of it, and samples that each and a spectrum's segment
# have.
_HARDLY, _MUCH_NEW, _OF_SWEEP, _SHORTEST, _SEGMENT = 0.1, 0.2, 100, 64, 1024
# Share of the sensor's power that must come from the reference, and that in few long segments,
# where chance has more of it; share of the excited band that counts as all of it.
_COHERENT, _COHERENT_LONG, _NEARLY = 0.8, 0.9, 0.9
# Lines to both sides over which the spectrum of the whole record is averaged.
_SMEARED = 4
# Frequencies worth exciting, as shares of the sampling rate: below the resonance, and as high as
# delays and an anti-aliasing filter leave a sensor.
_LOWEST, _HIGHEST = 0.01, 0.4
_BLOCKS = 20


@dataclasses.dataclass(frozen=True)
class Excitation:
    """How the reference has excited the sensor, and how much of the record counts.

    Attributes
    ----------
    kind : str
        See `Recognised`.
    description : str
        The kind in words, with its main figures.
    order : int
        Order of persistent excitation.
    needed : int
        Parameters to be identified.
    band_hz : tuple of float
        Where the sensor follows the reference (`excited_band`): the model's.
    excited_hz : tuple of float
        Where the reference has power.
    rms, peak : float
        Of the reference's motion, its mean taken off [m/s²].
    crest_factor : float
        Peak over RMS.
    quietest_rms, loudest_rms : float
        Least and greatest RMS of the twentieths of the record [m/s²].
    noise_std : float
        Standard deviation that the messages state for the sensor's noise; NaN without.
    samples, missing, clipped, standing : int
        Instants of the record; without a sample; clipped; at which one topic stood still while
        the other moved.
    """

    kind: str
    description: str
    order: int
    needed: int
    band_hz: tuple
    excited_hz: tuple
    rms: float
    peak: float
    crest_factor: float
    quietest_rms: float
    loudest_rms: float
    noise_std: float
    samples: int
    missing: int
    clipped: int
    standing: int

    @classmethod
    def of(cls, record, reference, sensor, order, needed, recognised):
        """Of one axis of a `RecordCheck`, with its order and its kind as recognised."""
        pair = record.pair
        motion = np.where(pair.valid, reference - reference[pair.valid].mean(), 0.0)
        first = np.arange(_BLOCKS) * len(motion) // _BLOCKS
        energies, counts = (np.add.reduceat(values, first)
                            for values in (motion**2, pair.valid.astype(float)))
        levels = np.sqrt(energies[counts > 0] / counts[counts > 0]).tolist()
        rms = float(np.sqrt(energies.sum() / counts.sum()))
        peak = float(np.max(np.abs(motion)))
        low, high = excited_band(reference, sensor, pair.sampling_rate_hz,
                                 recognised.kind == "sweep")
        excited = tuple(recognised.band_hz) or powerful_band(reference, pair.sampling_rate_hz)
        # above it nothing can be compared
        band = (low, min(high, pair.band_hz)) if pair.band_hz else (low, high)
        return cls(recognised.kind, recognised.words, order, needed, band, excited, rms, peak,
                   peak / rms, min(levels), max(levels), pair.sensor_std, len(pair),
                   record.missing, record.clipped, record.standing)

    @property
    def words(self):
        """Two lines for a user."""
        low, high = self.excited_hz
        left_out = [f"{count} {what}" for count, what in (
            (self.missing, "missing"), (self.clipped, "clipped"),
            (self.standing, "standing still")) if count]
        return (f"{self.description}; excited from {low:.4g} to {high:.4g} Hz, of order "
                f"{self.order} (at least {self.needed} needed)"
                f"{'; ' if self.followed else ''}{self.followed}"
                f"{'; samples left out: ' if left_out else ''}{', '.join(left_out)}\n"
                f"reference RMS {self.rms:.4g} m/s^2 ({self.quietest_rms:.3g} to "
                f"{self.loudest_rms:.3g} along the record), peak {self.peak:.4g} m/s^2, crest "
                f"factor {self.crest_factor:.3g}")


    @property
    def followed(self):
        """Where the sensor follows, in words; empty where that is all that is excited."""
        (low, high), (first, last) = self.band_hz, self.excited_hz
        if high > _NEARLY * last and low < max(2 * first, (1 - _NEARLY) * last):
            return ""
        return (f"the sensor follows the reference from {low:.4g} to {high:.4g} Hz only (coherence "
                f"above {_COHERENT})")


def powerful_band(reference, sampling_rate_hz):
    """Lowest and highest frequency at which the reference has power [Hz].

    With the resolution of the whole record; the lowest is 0 where that does not tell it from zero.
    """
    n = len(reference)
    taper = np.hanning(n)
    lines = np.abs(rfft((reference - reference @ taper / taper.sum()) * taper))**2
    # the mean of neighbours, as single lines of noise may be small
    power = uniform_filter1d(lines, 2 * _SMEARED + 1, mode="reflect")
    strong = np.flatnonzero(power > _FLOOR * power.max())
    if not len(strong):
        return 0.0, 0.0
    low = strong[0] + _SMEARED if strong[0] > 0 else 0
    high = max(strong[-1] - _SMEARED, low) if strong[-1] < len(power) - 1 else strong[-1]
    return float(low * sampling_rate_hz / n), float(high * sampling_rate_hz / n)


def excited_band(reference, sensor, sampling_rate_hz, sweep=False):
    """Band in which the reference has power and the sensor answers to it.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
    sampling_rate_hz : float
    sweep : bool
        Whether each frequency comes once. The last ones come where the windows of long segments
        have faded.

    Returns
    -------
    tuple of float
        Lowest and highest frequency [Hz] between which both hold for most frequencies.
    """
    low, high = _followed(reference, sensor, sampling_rate_hz, _segment(reference))
    if sweep and len(reference) >= _OF_SWEEP * _SHORTEST:
        high = max(high, _followed(reference, sensor, sampling_rate_hz,
                                   len(reference) // (_OF_SWEEP // 4))[1])
    return low, high


def _followed(reference, sensor, sampling_rate_hz, segment):
    """The same with segments of some length."""
    frequency = np.fft.rfftfreq(segment, 1 / sampling_rate_hz)
    power = power_of(segment_spectra(reference, "blackmanharris", segment))
    # short segments average more; but the sensor may answer for longer than one lasts
    agreeing = np.zeros(len(frequency), bool)
    for length, least in ((segment // 4, _COHERENT), (segment, _COHERENT_LONG)):
        shared = coherence_of(*(segment_spectra(values, "hann", length)
                                for values in (reference, sensor)))
        agreeing |= np.interp(frequency, np.linspace(0, sampling_rate_hz / 2, len(shared)),
                              shared) > least
    strong = ((power > _FLOOR * power.max()) & agreeing).astype(float)
    # where most of five neighbours are strong
    most = np.flatnonzero(np.convolve(strong, np.ones(5), "same") > 2)
    if not len(most):
        most = np.flatnonzero(power > 0.1 * power.max())
    if not len(most):
        raise IdentificationError("the reference's power is not a number at any frequency: its "
                                  "values are too large or too small to be squared")
    # the window smears what is next to zero into it
    low = frequency[most[0]] if most[0] > 2 else 0.0
    return float(low), float(frequency[most[-1]])


def highest_excited(reference):
    """Highest frequency at which the reference has power [of the sampling rate]."""
    frequency, power = _spectrum(reference, 1.0)
    return frequency[np.flatnonzero(power > _FLOOR * power.max())[-1]]


def persistent_excitation(reference, sampling_rate_hz):
    """Order of persistent excitation and the lines that give it.

    Each sine is persistently exciting of order 2 (L. Ljung, *System Identification*, 2nd ed.,
    section 13.2); a stretch of continuous spectrum counts as many as its width holds. Where
    averaged segments tell few lines apart and the record is none of sines, such as a short sweep,
    they are counted with the resolution of the whole record.

    Returns
    -------
    order : int
    lines_hz : list of float
        Frequencies of the lines, or places within a stretch of continuous spectrum.
    """
    lines = _lines(*_spectrum(reference, sampling_rate_hz, weighted_mean=True))
    if 2 * len(lines) < _FEW and recognise(reference, sampling_rate_hz).kind not in _OF_SINES:
        lines = _lines(*_spectrum(reference, sampling_rate_hz, True, len(reference)))
    return 2 * len(lines), lines


def _lines(frequency, power):
    """Lines of a spectrum [Hz]."""
    strong = np.flatnonzero(power > _FLOOR * power.max())
    stretches = np.split(strong, np.flatnonzero(np.diff(strong) > 1) + 1) if len(strong) else []
    lines = []
    for stretch in stretches:
        count = max(1, round(len(stretch) / _LINE_BINS))
        first = np.arange(count) * len(stretch) // count
        weight, moment = (np.add.reduceat(values[stretch], first)
                          for values in (power, power * frequency))
        lines += (moment / weight).tolist()
    return lines


def require_excitation(reference, sampling_rate_hz, parameters):
    """Refuse data that cannot identify so many parameters.

    Raises
    ------
    IdentificationError
        Saying what is excited, how much is needed and where.
    """
    require_order(*persistent_excitation(reference, sampling_rate_hz), sampling_rate_hz, parameters)


def require_order(order, lines, sampling_rate_hz, parameters):
    """The same of a known order of excitation and the lines that give it."""
    if order >= parameters:
        return
    needed = -(-parameters // 2)
    where = " and ".join(f"{line:.4g} Hz" for line in lines)
    raise IdentificationError(
        f"the reference excites only {where}: persistently exciting of order {order}, but "
        f"{parameters} parameters are to be identified; excite at least {needed} frequencies, "
        f"spread below and across the sensor's resonance (where that is unknown: from "
        f"{_LOWEST * sampling_rate_hz:.3g} to {_HIGHEST * sampling_rate_hz:.3g} Hz, besides {where}"
        f" for instance {_missing_lines(lines, needed, sampling_rate_hz)}), or use noise, a sweep "
        "or a shock")


def _missing_lines(lines, needed, sampling_rate_hz):
    """Frequencies to add to the lines that there are: each in the widest gap, in octaves."""
    ends = np.log([_LOWEST * sampling_rate_hz, _HIGHEST * sampling_rate_hz])
    known, added = list(np.log(np.maximum(lines, 1e-300))), []
    for _ in range(needed - len(lines)):
        places = np.linspace(*ends, 61)
        distance = np.min(np.abs(places[:, None] - known), axis=1)
        added.append(places[np.argmax(distance)])
        known.append(added[-1])
    return " and ".join(f"{np.exp(line):.3g} Hz" for line in added)


def strongest_stretch(reference, length, valid=None):
    """Slice of `length` samples in which the reference has most energy; all of a shorter record.

    Only `valid` samples count, if given.
    """
    if len(reference) <= length:
        return slice(0, len(reference))
    energy = np.r_[0, _energy(reference, valid)]
    first = int(np.argmax(energy[length:] - energy[:-length]))
    return slice(first, first + length)


def held_out(reference, valid=None):
    """Which samples are not learnt from, but judged on, as a mask.

    The last ones, from where a share of the reference's energy has come. Where these are quiet, as
    after a shock, or few, as where a record ends with one, or move at frequencies that come nowhere
    before, as in a sweep, every other stretch. Only `valid` samples count, if given.
    """
    energy = _energy(reference, valid)
    last = np.arange(len(reference)) >= np.searchsorted(energy, _LEARN * energy[-1])
    moving = reference - reference.mean()
    if np.std(moving[last]) < _QUIET_END * np.std(moving[~last]) \
            or min(last.sum(), np.sum(~last)) < _FEW_SAMPLES * len(last):
        return alternating_stretches(reference, STRETCHES, valid)
    if is_new(moving[~last], moving[last]):
        return alternating_stretches(reference, min(_OF_SWEEP, len(reference) // _SHORTEST),
                                     valid)
    return last


def held_out_of(reference, used):
    """The same; where hardly any that count would be on either side, as after a sensor has failed,
    by the energy of those that count."""
    rest = held_out(reference)
    few = _FEW_SAMPLES * used.sum()
    return rest if min(np.sum(used & rest), np.sum(used & ~rest)) > few \
        else held_out(reference, used)


def alternating_stretches(reference, count, valid=None):
    """Every other of `count` stretches in which the reference has equal energy, as a mask.

    What is learnt from the others is judged under the same kind of motion: the end of a shock is
    not like its beginning. The first one is learnt from: only there what was before the record
    shows. Only `valid` samples count, if given.
    """
    energy = _energy(reference, valid)
    return (energy * (count / max(energy[-1], 1e-300))).astype(int) % 2 == 1


def is_new(before, after):
    """Whether much of a motion has frequencies that the one before it hardly has."""
    length = min(len(before), len(after), _SEGMENT)
    if length < _SHORTEST:
        return False
    known, energy = (len(part) * power_of(segment_spectra(part, "blackmanharris", length))
                     for part in (before, after))
    return energy[known < _HARDLY * energy].sum() > _MUCH_NEW * energy.sum()


def _energy(reference, valid=None):
    power = np.square(reference - reference.mean())
    return np.cumsum(power if valid is None else power * valid)


def _spectrum(reference, sampling_rate_hz, weighted_mean=False, length=None):
    length = length or _segment(reference)
    return (np.fft.rfftfreq(length, 1 / sampling_rate_hz),
            power_of(segment_spectra(reference, "blackmanharris", length, weighted_mean)))


def _segment(reference):
    return min(len(reference), max(256, len(reference) // 4))
