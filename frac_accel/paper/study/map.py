"""When a fractional model helps, over orders, noise levels and bandwidths."""

import concurrent.futures
import contextlib
import dataclasses
import itertools
import multiprocessing
import signal

import numpy as np
from scipy.stats import t as student

from .candidates import AS_MANY, CLASSICAL, FRACTIONAL
from .virtual import Case, outcome

ORDERS = tuple(round(0.5 + 0.1 * i, 1) for i in range(11))
NOISE_DB = (60.0, 40.0, 20.0)
# Below the resonance of 650 Hz, up to it, and past it.
BANDS_HZ = (300.0, 600.0, 1500.0)
SEEDS = 4
_WORKERS = 2

HELPS = "helps"
SEEMS = "only seems to help"
DOES_NOT = "does not help"
OPEN = "undecided"
# What each verdict means, for readers.
VERDICTS = {
    HELPS: "it predicts better than each classical model, also the best one of as many parameters",
    SEEMS: "it predicts better than the classical oscillator, but worse than the best classical "
           "model of as many parameters: it takes the place of something else",
    DOES_NOT: "a classical model predicts better",
    OPEN: "the noise of the record decides which predicts better: the intervals include 1",
}


@dataclasses.dataclass(frozen=True)
class Cell:
    """Records of one sensor at one noise level and bandwidth.

    Attributes
    ----------
    case : Case
        Of the first record.
    outcomes : tuple of Outcome
        One for each seed.
    """

    case: Case
    outcomes: tuple

    def errors(self, name):
        """Errors of a candidate within the paper's band, one for each record; NaN without a fit."""
        return np.array([one.inside.get(name, np.nan) for one in self.outcomes])

    @property
    def best_classical(self):
        """Smallest error of all classical models, one for each record, chosen afterwards."""
        return np.nanmin([self.errors(name) for name in (CLASSICAL, *AS_MANY)], axis=0)

    @property
    def gains(self):
        """Error of the best classical model over the fractional one's, one for each record."""
        return self.best_classical / self.errors(FRACTIONAL)

    @property
    def gain(self):
        """Geometric mean of the gains."""
        return float(np.exp(np.mean(np.log(self.gains))))

    @property
    def gain_interval(self):
        """95 % interval of that mean, by Student's t on its logarithm."""
        return _interval(self.gains)

    @property
    def verdict(self):
        """One of `VERDICTS`, by the intervals."""
        low, high = self.gain_interval
        if low > 1:
            return HELPS
        fractional = self.errors(FRACTIONAL)
        over_oscillator = _interval(self.errors(CLASSICAL) / fractional)
        over_rival = _interval(np.array([one.rival for one in self.outcomes]) / fractional)
        if over_oscillator[0] > 1 and over_rival[1] < 1:
            return SEEMS
        return DOES_NOT if high < 1 else OPEN

    def as_dict(self):
        """Plain numbers."""
        return {"order": self.case.order, "lagging": self.case.lagging,
                "noise_db": self.case.noise_db, "band_hz": self.case.band_hz,
                "verdict": self.verdict, "gain": self.gain,
                "gain_interval": list(self.gain_interval),
                "error": {name: float(np.median(self.errors(name)))
                          for name in self.outcomes[0].inside},
                "error_beyond": {name: float(np.median([one.beyond.get(name, np.nan)
                                                        for one in self.outcomes]))
                                 for name in self.outcomes[0].beyond},
                "noise_floor": float(np.median([one.floor for one in self.outcomes])),
                "identified_order": [one.order for one in self.outcomes],
                "identified_order_std": [one.order_std for one in self.outcomes],
                "order_significant": [one.significant for one in self.outcomes]}


def _interval(ratios):
    """95 % interval of the geometric mean of positive values."""
    logs = np.log(ratios)
    half = student.ppf(0.975, len(logs) - 1) * logs.std(ddof=1) / np.sqrt(len(logs))
    return float(np.exp(logs.mean() - half)), float(np.exp(logs.mean() + half))


def cases():
    """All cases of the map, in groups of one cell."""
    sensors = [(order, False) for order in ORDERS] + [(1.0, True)]
    return [[Case(*sensor, noise, band, seed) for seed in range(SEEDS)]
            for sensor, noise, band in itertools.product(sensors, NOISE_DB, BANDS_HZ)]


@contextlib.contextmanager
def workers():
    """Two processes that an interruption ends at once."""
    pool = concurrent.futures.ProcessPoolExecutor(
        _WORKERS, multiprocessing.get_context("fork"), signal.signal,
        (signal.SIGINT, signal.SIG_IGN))
    try:
        yield pool
    finally:
        # what is not begun is left undone
        pool.shutdown(cancel_futures=True)


def make_map(pool, progress):
    """Fit and judge all candidates on the records of all cells.

    Parameters
    ----------
    pool : concurrent.futures.Executor
    progress : callable
        Called after each cell.

    Returns
    -------
    list of Cell
    """
    result = []
    for cell in pool.map(cell_of, cases()):
        result.append(cell)
        progress()
    return result


def cell_of(group):
    """Cell of a group of cases."""
    return Cell(group[0], tuple(outcome(case) for case in group))
