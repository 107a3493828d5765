"""The bench's recorded bags: models identified from noise, judged on sines."""

import dataclasses
from pathlib import Path

import numpy as np

from ...diagnosis import diagnose
from ...errors import BagError, IdentificationError
from ...identification import identify
from ...record import Record
from .. import BAGS, published
from ..tables import errors_percent
from .candidates import fit_all
from .judge import Sines, judge, rms
from .sweep import best, damping_orders, sweep, table_4

# The sensors of the bench, and those whose orders are swept.
SENSORS = {"classical": "classical sensor, damping order 1",
           "fractional": "fractional sensor, damping order 0.6",
           "lagging": "classical sensor behind a low-pass that the models do not know of"}
SWEPT = ("classical", "fractional")
ONE_SINE = "paper_bench_one_sine.mcap"


@dataclasses.dataclass(frozen=True)
class BenchResult:
    """One sensor of the bench.

    Attributes
    ----------
    name, words : str
    frequency_hz : ndarray, shape (m,)
        Of the sines.
    fitted : dict of str to Fitted
    judged : dict of str to Judged
    chosen, reason : str
        Structure that ``identify`` chooses, and why.
    sampled : dict
        The transfer function in z, and what becomes of it in s: see `sampled_model`.
    by_damping_order, by_table_4 : list of SweptOrder
        Empty where the orders are not swept.
    """

    name: str
    words: str
    frequency_hz: object
    fitted: dict
    judged: dict
    chosen: str
    reason: str
    sampled: dict
    by_damping_order: list
    by_table_4: list

    def as_dict(self):
        """Plain numbers and lists."""
        result = {"sensor": self.words, "frequency_hz": self.frequency_hz.tolist(),
                  "chosen": self.chosen, "reason": self.reason, "sampled_model": self.sampled,
                  "models": {name: {"parameters": self.fitted[name].parameters,
                                    "values": dict(zip(self.fitted[name].fit.names,
                                                       self.fitted[name].fit.values.tolist())),
                                    "std": dict(zip(self.fitted[name].fit.names,
                                                    self.fitted[name].fit.std.tolist())),
                                    **judged.as_dict()}
                             for name, judged in self.judged.items()}}
        for key, swept in (("by_damping_order", self.by_damping_order),
                           ("by_table_4", self.by_table_4)):
            if swept:
                result[key] = {"best": best(swept).as_dict(),
                               "orders": [one.as_dict() for one in swept]}
        return result


def bags_of(folder):
    """Paths of all bags, by what they are for.

    Raises
    ------
    BagError
        If one is missing.
    """
    folder = BAGS if folder is None else Path(folder)
    paths = {name: (folder / f"paper_bench_{name}.mcap", folder / f"paper_bench_{name}_sines.mcap")
             for name in SENSORS}
    paths["one_sine"] = (folder / ONE_SINE,)
    for group in paths.values():
        for path in group:
            if not path.exists():
                raise BagError(f"{path}: no such bag; the study needs the paper_bench bags of the "
                               "project's folder bags/: give their folder with --bags, or leave "
                               "the study out with --quick")
    return paths


def judge_sensor(name, paths, progress=lambda: None, orders=None):
    """BenchResult of one sensor from its two bags.

    Parameters
    ----------
    name : str
        One of `SENSORS`.
    paths : tuple of Path
        The record to identify from, and that of sines.
    progress : callable
        Called after each fit of a sweep.
    orders : tuple of two lists of (float, float), optional
        Orders to sweep; default: the paper's sweep and its Table 4, for the sensors in `SWEPT`.
    """
    if orders is None:
        orders = (damping_orders(), table_4()) if name in SWEPT else ([], [])
    pair, sines = Record.load(paths[0]), Sines.of(Record.load(paths[1]))
    fits = fit_all(pair.reference[:, 0], pair.sensor[:, 0], pair.sampling_rate_hz, pair.valid,
                   pair.lag_s)
    found = identify(pair)
    swept = [sweep(pairs, pair, sines, progress) for pairs in orders]
    return BenchResult(name, SENSORS[name], sines.points.frequency_hz, fits,
                       {key: judge(fit, sines) for key, fit in fits.items()},
                       found.structure, found.reason, sampled_model(pair, sines), *swept)


def sampled_model(pair, sines):
    """A transfer function in z, with its poles in s, and with its numbers put into s.

    Returns
    -------
    dict
        ``held_out_rms``: relative error of the model in z in the paper's band; ``poles``: natural
        frequencies and damping ratios by s = rate ln z; ``leading_coefficient`` of its numerator;
        ``substituted_error_percent``: the paper's measure, against the reference, of the
        differential equation with the coefficients of z, as the paper has it.
    """
    model = identify(pair, structure="arx").model
    core = model.axis("x").core
    frequency = sines.points.frequency_hz
    error = model.frequency_response(frequency) / sines.points.response - 1
    s = 2j * np.pi * np.array(published.FREQUENCY_HZ)
    substituted = np.polyval(core.numerator, s) / np.polyval(core.denominator, s)
    return {"held_out_rms": rms(error[sines.inside]),
            "poles": model.metadata["continuous_equivalent"]["poles"],
            "leading_coefficient": core.numerator[0] / core.denominator[0],
            "substituted_error_percent": list(errors_percent(substituted))}


def diagnosed(path):
    """What ``diagnose`` says of a record by itself, as in its result file."""
    return diagnose(path).as_dict()


def refusal(path):
    """What ``identify`` says to the paper's own excitation; empty if it takes it."""
    try:
        identify(path)
    except IdentificationError as error:
        return str(error)
    return ""
