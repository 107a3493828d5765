"""The answer to the paper's question in five sentences, which follow from the study's numbers."""

import numpy as np

from ..claims.orders import order_combinations
from .candidates import AS_MANY, CLASSICAL, FRACTIONAL
from .map import HELPS, SEEMS
from .virtual import NATURAL_HZ

# Probability below which an error is more than its uncertainty.
_P_VALUE = 0.01


def answer(bench, cells, refusal):
    """Five sentences.

    Parameters
    ----------
    bench : dict of str to BenchResult
    cells : list of Cell
    refusal : str

    Returns
    -------
    list of str
    """
    return [_fractional(bench["fractional"]), _classical(bench["classical"], cells),
            _where(cells), _seems(bench["lagging"], cells), _paper(refusal)]


def at_floor(judged):
    """Whether a held-out error is no more than its uncertainty."""
    return judged.p_value >= _P_VALUE


def rival(result):
    """Classical model of as many parameters with the smallest held-out error: name and Judged."""
    name = min(AS_MANY, key=lambda key: result.judged[key].rms)
    return name, result.judged[name]


def factor(value):
    """A ratio of two errors, to two digits."""
    return f"{value:.0f}" if value >= 100 else f"{value:.2g}"


def _percent(judged):
    low, high = judged.rms_interval
    return f"{100 * judged.rms:.2g} % ({100 * low:.2g} to {100 * high:.2g} %)"


def _fractional(result):
    own, (name, other) = result.judged[FRACTIONAL], rival(result)
    order, _ = result.fitted[FRACTIONAL].order
    ratio = other.rms / own.rms
    floor = "at the noise floor" if at_floor(own) else "above the noise floor"
    verdict = "helps" if ratio > 1 and not at_floor(other) else "does not help"
    return (f"Where the damping is fractional (order {order:.3f} on the bench), a fractional model "
            f"{verdict}: its held-out error from 100 to 500 Hz is {_percent(own)}, {floor}, and "
            f"that of the best classical model with as many parameters ({name}) {_percent(other)}, "
            f"{factor(ratio)} times as much.")


def _classical(result, cells):
    own, plain = result.judged[FRACTIONAL], result.judged[CLASSICAL]
    order, std = result.fitted[FRACTIONAL].order
    same = at_floor(own) and at_floor(plain)
    verdict = "does not help" if same or own.rms >= plain.rms else "helps"
    chosen = "is classical" if result.chosen == "oscillator" else f"is {result.chosen}"
    return (f"Where the damping is classical it {verdict}: the order is found to be {order:.4f} ± "
            f"{std:.1g}, the model that identify selects {chosen}, and the held-out errors are "
            f"{_percent(own)} with a free order and {_percent(plain)} without"
            + (", both at the noise floor" if same else "") + _illusion(cells) + ".")


def _illusion(cells):
    """How often the free order fits a classical sensor's record better, and predicts worse."""
    outcomes = [one for cell in cells if cell.case.order == 1 and not cell.case.lagging
                for one in cell.outcomes]
    if not outcomes:
        return ""
    fits = [one.residual[FRACTIONAL] < one.residual[CLASSICAL] for one in outcomes]
    worse = [one.inside[FRACTIONAL] > one.inside[CLASSICAL] for one in outcomes]
    return (f"; in the map it leaves a smaller residual in {sum(fits)} of {len(fits)} records of "
            f"classical sensors, and predicts worse in {sum(worse)} of them")


def _where(cells):
    proper = [cell for cell in cells if not cell.case.lagging]
    helping = [cell for cell in proper if cell.verdict == HELPS]
    if not helping:
        return (f"Over the map of {len(proper)} combinations of order, noise and bandwidth a "
                "fractional model helps nowhere.")
    gains = [cell.gain for cell in helping]
    true = [cell for cell in proper if cell.case.order != 1]
    wrong = sum(cell.case.order == 1 for cell in helping)
    by_noise = _shares(true, lambda cell: cell.case.noise_db,
                       lambda level: f"with noise of {100 * 10**(-level / 20):g} %")
    by_band = _shares(true, lambda cell: cell.case.band_hz,
                      lambda band: f"excited up to {band:g} Hz")
    return (f"Over the map it helps in {len(helping) - wrong} of {len(true)} combinations with a "
            f"fractional sensor ({by_noise}; {by_band}, the resonance being at {NATURAL_HZ:g} Hz), "
            f"by a factor of {factor(np.median(gains))} (median; {factor(min(gains))} to "
            f"{factor(max(gains))}), and in {wrong} of {len(proper) - len(true)} with a classical "
            "one.")


def _shares(cells, key, words):
    """In how many cells of each kind it helps."""
    counts = {}
    for cell in cells:
        helped, of = counts.get(key(cell), (0, 0))
        counts[key(cell)] = helped + (cell.verdict == HELPS), of + 1
    return ", ".join(f"{helped} of {of} {words(value)}" for value, (helped, of) in counts.items())


def _seems(result, cells):
    own, plain, (name, other) = (result.judged[FRACTIONAL], result.judged[CLASSICAL],
                                 rival(result))
    order, std = result.fitted[FRACTIONAL].order
    lagging = [cell for cell in cells if cell.case.lagging]
    seeming = sum(cell.verdict == SEEMS for cell in lagging)
    if own.rms < plain.rms and other.rms < own.rms:
        return (f"It only seems to help where something else is missing: behind an unknown "
                f"low-pass a classical sensor is given the order {order:.3f} ± {std:.1g}, which "
                f"lowers the held-out error from {100 * plain.rms:.2g} to {100 * own.rms:.2g} %, "
                f"while the right cause ({name}) with as many parameters leaves "
                f"{100 * other.rms:.2g} %; so it is in {seeming} of {len(lagging)} such "
                "combinations of the map.")
    return (f"Behind an unknown low-pass the fractional model of a classical sensor has the "
            f"held-out error {100 * own.rms:.2g} %, the classical one {100 * plain.rms:.2g} %, and "
            f"{name} {100 * other.rms:.2g} %.")


def _paper(refusal):
    combinations = order_combinations()
    spread = combinations.numbers["spread_db"]
    could = "could not be identified" if refusal else "could be identified"
    decide = "cannot decide it" if spread < 0.05 or refusal else "bear on it"
    return (f"The paper's own data {decide}: from its excitation, one sine, the order {could}, all "
            f"its orders give the same gain to {spread:.2g} dB, and the decrease of the error that "
            "it reports is that of putting the coefficients of z into an equation in s.")
