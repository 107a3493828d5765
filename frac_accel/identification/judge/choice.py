"""Which structure the data call for, and what several records say together."""

import dataclasses

import numpy as np

from ...errors import FracAccelError, IdentificationError, naming
from ..fit.structures import OscillatorStructure
from ..fit.uncertainty import SIGNIFICANT
from ..response.excitation import excited_band
from ..response.frequency_response import linear_share
from .candidate import Candidate, fit_of, fitted
from .fit_validation import judge_residual
from .notes import MOST_LEFT
from .records import agreement, combine, freed, is_open

# Share of an oscillator's held-out residual that a model which names no cause may leave.
_CLEARLY = 0.7
# Share of what a linear model could still explain of the classical residual that a fractional
# damping must take away, and the share of a residual that chance alone seems to explain.
_TAKEN, _SEEMING = 0.5, 0.1
# Least share of the classical held-out residual (RMS) that a fractional damping must take away to
# matter, whatever its significance, with an order that near to 1; of the output, where noise hides
# that.
_MATTERS, _NEAR_ONE, _OF_OUTPUT = 0.01, 0.1, 3e-3
# Share of an order's distance from 1 by which both domains must differ to contradict each other.
_OTHER_ORDER = 1 / 3
# A resonance that far above the excited band, or known no better than this, is out of sight; of a
# gain, the held-out residual over that with a resonance with which the gain will do.
_IN_SIGHT, _UNDETERMINED, _NO_BETTER = 1.5, 0.2, 1.05
# Share of an oscillator's own delay that a lead must take back to stand for a smoothed reference;
# less is a clock's. Damping ratio below which the delay counts as if it were that: what smoothes a
# reference so that it feigns a peak leads by as much.
_TAKEN_BACK, _LEAST_DAMPED = 0.1, 0.5
# Damping ratio from which on a resonance just beyond the band shows no peak in it, and share of its
# delay without which it is the low-pass without a phase that comes before samples are thinned out.
_PEAKLESS, _ALL_TAKEN_BACK = 0.5, 0.5
# Time constants after which a motion from before the record counts no more, and samples at both
# ends that the band-limited simulation cannot know.
_SETTLING = 7.0
_EDGE = 32


class _Fitted(dict):
    """Candidates of one record by the names of their structures, each fitted once."""

    def __init__(self, data):
        super().__init__()
        self.data = data

    def __missing__(self, name):
        self[name] = Candidate.of(name, self.data)
        return self[name]


def choose(data):
    """Best of the structures for one record, and why."""
    candidates = _Fitted(data)
    flat = _flat_instead(candidates)
    chosen, best, reason = (flat[0], flat[0].held_out_nrmse, flat[1]) if flat \
        else _choose_oscillator(candidates)
    if linear_share(data.reference, chosen.fit.residual) < 1 - _CLEARLY**2:
        return chosen, reason
    try:
        arx = Candidate.of("arx", data)
    except IdentificationError:
        return chosen, reason
    others = "a gain" if flat else "an oscillator with classical or fractional damping"
    rival = candidates["oscillator"].held_out_nrmse
    if flat and rival < best:
        # not believed, but what names nothing must do better than its three parameters
        others, best = "a gain or an oscillator", rival
    held_out = _against("held-out residual", arx.held_out_nrmse, best)
    if not arx.held_out_nrmse < _CLEARLY * best:
        return chosen, (f"{reason}; a free transfer function in z does not predict clearly better: "
                        f"{held_out}")
    return arx, (f"it predicts clearly better than {others}: {held_out}; something else acts, "
                 "which its coefficients cannot name")


def choose_classical(data):
    """A gain where the record shows no resonance, otherwise an oscillator, and why."""
    candidates = _Fitted(data)
    return _flat_instead(candidates) or (candidates["oscillator"], "a resonance shows")


def _flat_instead(candidates):
    """A gain and why, or None where the record shows the resonance of an oscillator.

    Whatever else makes fast motion smaller, such as a smoothed reference, bends a resonance out
    there to its liking; it is believed only where it predicts clearly better.

    Raises
    ------
    IdentificationError
        If the oscillator predicts nothing of held-out data, and there is no gain either.
    """
    nothing = False
    try:
        classical = candidates["oscillator"]
        data, resonance = candidates.data, classical.fit["natural_frequency_hz"]
        std = classical.fit.std[classical.fit.names.index("natural_frequency_hz")]
        highest = excited_band(data.reference, data.sensor, data.pair.sampling_rate_hz,
                               data.response.excitation.kind == "sweep")[1]
        highest = min(highest, data.pair.band_hz or np.inf)
        # such a one may have integrated the motion to follow a zero that wanders
        nothing = classical.held_out_nrmse > 1
        # no sensor's delay is as long as the search goes
        astray = "delay_s" in classical.fit.at_bounds
        in_sight = (resonance < _IN_SIGHT * highest and std < _UNDETERMINED * resonance
                    and not nothing and not astray)
        if in_sight and not _without_its_delay(classical.fit, highest):
            return None
        flat = candidates["gain"]
    except IdentificationError:
        if nothing:
            raise
        return None
    lead, share = _lead(classical.fit)
    left = flat.held_out_nrmse
    if left <= _NO_BETTER * classical.held_out_nrmse:
        why = "does not predict clearly better than a gain"
    elif astray:
        why = f"needs {classical.fit['delay_s']:.3g} s of delay, and the search goes no further"
    elif share > _TAKEN_BACK and (
            not in_sight or classical.held_out_nrmse > _CLEARLY * left):
        why = (f"would answer {lead:.3g} s before the reference moves, as if that were smoothed; "
               "its parameters are open, and a gain is all that can be said")
    else:
        return None
    place = f"at {resonance:.4g} ± {std:.2g} Hz" if std < resonance else "at any frequency above"
    return flat, (f"no resonance shows up to {highest:.4g} Hz: an oscillator {place} {why} "
                  f"({_against('held-out residual', classical.held_out_nrmse, left)})")


def _against(judged, one, other, of_other=""):
    """What two candidates leave of data that they have not seen, in words."""
    if not np.isfinite([one, other]).all():
        return "the record is too short to hold data out"
    return f"{judged} {one:.3%} against {other:.3%}{of_other}"


def _lead(fit):
    """Significant lead of an oscillator [s], and its share of the oscillator's own delay; or 0."""
    place = fit.names.index("delay_s")
    lead = -fit.values[place]
    if not lead > SIGNIFICANT * fit.std[place]:
        return 0.0, 0.0
    own = max(fit["damping_ratio"], _LEAST_DAMPED) / (np.pi * fit["natural_frequency_hz"])
    return lead, lead / own


def _without_its_delay(fit, highest):
    """Whether an oscillator has its resonance beyond the band, no peak, and hardly its delay left.

    A low-pass without a phase does that, as loggers have it before they thin out samples.
    """
    return (fit["natural_frequency_hz"] > highest and fit["damping_ratio"] > _PEAKLESS
            and _lead(fit)[1] > _ALL_TAKEN_BACK)


def choose_of_several(structure, datas, records):
    """Combined model of several records, why its structure, and how the records agree.

    Parameters
    ----------
    structure : str
    datas : list of Data
    records : list of str
        Their names.

    Returns
    -------
    Candidate, str, RecordAgreement
    """
    if structure != "auto":
        chosen, agreeing = _combined(structure, datas, records)
        return chosen, "requested", agreeing
    classical, agreeing = _combined("oscillator", datas, records)
    try:
        fractional, fractionally = _combined("fractional", datas, records)
    except IdentificationError as error:
        return classical, f"no fractional model: {error}", agreeing
    better, reason = _preferred(classical, fractional, datas, "residual on other records")
    return better, reason, fractionally if better is fractional else agreeing


def _choose_oscillator(candidates):
    """The better of classical and fractional, the smallest held-out residual, and why."""
    classical = candidates["oscillator"]
    try:
        fractional = candidates["fractional"]
    except IdentificationError as error:
        return classical, classical.held_out_nrmse, f"no fractional model: {error}"
    chosen, reason = _preferred(classical, fractional, [candidates.data], "held-out residual")
    return chosen, min(classical.held_out_nrmse, fractional.held_out_nrmse), reason


def _preferred(classical, fractional, datas, judged):
    """The better of two candidates of the same records, and why."""
    order = fractional.fit["damping_order"]
    std = fractional.fit.std[fractional.fit.names.index("damping_order")]
    score = f"damping order {order:.4g} ± {std:.2g}"
    held_out = _against(judged, fractional.held_out_nrmse, classical.held_out_nrmse,
                        " of the classical model")
    if abs(order - 1) <= SIGNIFICANT * std:
        return classical, f"a fractional damping is not significant: {score}"
    if not fractional.held_out_nrmse < classical.held_out_nrmse:
        return classical, f"a fractional damping does not predict better: {held_out}"
    if not _matters(order, classical.held_out_nrmse, fractional.held_out_nrmse):
        return classical, f"a fractional damping does not predict clearly better: {held_out}"
    if fractional.held_out_nrmse > MOST_LEFT:
        return classical, f"a fractional damping leaves most of held-out data, too: {held_out}"
    if not _explains(classical, fractional, datas):
        return classical, ("a fractional damping does not explain what the classical model lacks: "
                           f"{held_out}")
    for fit, data in zip(fractional.fits, datas):
        contradicted = _contradicted(fractional.structure, fit, data)
        if contradicted:
            return classical, contradicted
    return fractional, f"{score} differs from 1; {held_out}"


def _matters(order, before, after):
    """Whether a held-out residual that is smaller is so by more than nobody would miss."""
    return (abs(order - 1) >= _NEAR_ONE or after < (1 - _MATTERS) * before
            or before**2 - after**2 > _OF_OUTPUT**2)


def _contradicted(structure, fit, data):
    """What the points of the frequency response say against a damping order, in words; or None.

    Noise of the reference, which a resonance amplifies, bends a fit in the time domain; the points
    are averages, in which most of it is gone.
    """
    compared, _ = data.response.compared(structure, fit)
    if compared is None:
        return None
    value, std = (compared["parameters"]["damping_order"][key] for key in ("value", "std"))
    own, own_std = fit["damping_order"], fit.std[fit.names.index("damping_order")]
    apart = abs(value - own)
    if apart <= max(SIGNIFICANT * np.hypot(std, own_std), _OTHER_ORDER * abs(own - 1)):
        return None
    return (f"the frequency response contradicts a fractional damping: order {own:.4g} ± "
            f"{own_std:.2g} in the time domain, {value:.4g} ± {std:.2g} in the frequency domain")


def _explains(classical, fractional, datas):
    """Whether the fractional damping takes its share of what the classical model lacks.

    Whatever else acts (a nonlinear spring, say) can make an order differ from 1 significantly that
    explains next to nothing of it.
    """
    taken = lacking = 0.0
    for one, other, data in zip(classical.fits, fractional.fits, datas):
        power = (one.rmse / data.spread)**2
        taken += power - (other.rmse / data.spread)**2
        lacking += power * max(linear_share(data.reference, one.residual) - _SEEMING, 0.0)
    return taken >= _TAKEN * lacking


def _combined(name, datas, records):
    """Candidate of all records together and their RecordAgreement."""
    with naming(records[0]):
        structure, first = fitted(name, datas[0])
    # the orders of a transfer function must be the same in all
    start, fits = first.unknowns if name == "arx" else None, [first]
    for record, data in zip(records[1:], datas[1:]):
        data.progress(f"fitting the {name} structure to {record}")
        with naming(record):
            fits.append(fit_of(structure, data, start))
    datas[0].progress(f"judging the {name} structure on the other records")
    table = [[data.predicted(structure, fit, _settled(structure, fit, data)) for data in datas]
             for fit in fits]
    compared, held = _held_alike(structure, fits, datas)
    combination = combine(compared)
    if held:
        combination = freed(combination, fits, held)
    joint = dataclasses.replace(first, values=combination.values,
                                covariance=combination.covariance)
    try:
        structure.core(joint).require_stable("core")
    except FracAccelError:
        raise IdentificationError(
            f"the records' models contradict each other so much (chi-squared "
            f"{combination.statistic:.3g} of {combination.freedom} degrees of freedom) that their "
            "mean is not stable; identify each record by itself") from None
    joined = [data.predicted(structure, joint, _settled(structure, joint, data))
              for data in datas]
    tests = [judge_residual(structure.core(fit), fit, data.reference, data.pair)
             for fit, data in zip(fits, datas)]
    result = agreement(records, fits, combination,
                       [[entry.nrmse for entry in row] for row in table],
                       [entry.nrmse for entry in joined],
                       all(test is None or test.independent for test in tests), compared, held)
    others = [(i, j) for i in range(len(fits)) for j in range(len(fits)) if i != j]
    worst = max(others, key=lambda pair: table[pair[0]][pair[1]].nrmse)
    return Candidate(structure, name, joint, tuple(fits),
                     float(np.sqrt(np.mean([entry.nrmse**2 for entry in joined]))),
                     float(np.sqrt(np.mean([table[i][j].nrmse**2 for i, j in others]))),
                     table[worst[0]][worst[1]]), result


def _held_alike(structure, fits, datas):
    """Fits to compare the records by, and what is held at the same value in all of them.

    A parameter that a record leaves open takes others with it along a curve, where linearised
    covariances call records of one sensor different.
    """
    held = {}
    compared = fits
    # only there is each unknown one parameter's own
    if type(structure) is not OscillatorStructure:
        return compared, held
    for name in structure.names:
        if not is_open(name, compared):
            continue
        position = fits[0].names.index(name)
        best = min(fits, key=lambda fit: fit.std[position] / fit.values[position])
        held[name] = best
        fixed = {structure.names.index(name): fit.unknowns[structure.names.index(name)]
                 for name, fit in held.items()}
        compared = [data.fit(structure, start=best.unknowns, held=fixed) for data in datas]
    return compared, held


def _settled(structure, fit, data):
    """Part of a record after the motion before it, which another record's model cannot know, and
    whose motion the reference has, however late it shows."""
    decay = np.abs(structure.core(fit).poles().real)
    slowest = np.min(decay, initial=np.inf)
    samples = _SETTLING * data.pair.sampling_rate_hz / slowest if slowest > 0 else np.inf
    late = fit["delay_s"] * data.pair.sampling_rate_hz
    most = len(data.sensor) // 4
    return slice(int(min(max(samples, _EDGE + late), most)), -int(min(_EDGE + max(-late, 0), most)))
