"""What a diagnosis rests on, as plain numbers, arrays and words: all that its page shows."""

import dataclasses

import numpy as np
from scipy.signal import welch

from ..identification.response.excitation import strongest_stretch
from ..model import AXES, SensorModel
from ..model.parameters import plain
from ..shown import above
from ..signals.thinning import close_up, legible, segment, thinned
from .leftover import Leftover

# Points of a signal, and samples of a spectrum's segments (half as many points).
MOST_POINTS, _SEGMENT = 2000, 4096
# Sets of causes that are kept.
_MOST_RIVALS = 14
# Upper ends of the classes of output, as shares of the samples; the last ones are the peaks.
_CLASSES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 1.0)
_BLOCKS = 60
_FEWEST = 16
IN_USE, EXTENDED = "model in use", "extended model"


@dataclasses.dataclass(frozen=True)
class Rival:
    """A set of causes that was fitted to the whole record.

    Attributes
    ----------
    causes : list of str
        Beside those that every set has.
    parameters : int
    rmse : float
        [output units]
    behind : float
        By how many variances of the noise the chosen set is ahead, with a penalty for each
        parameter.
    chosen : bool
    """

    causes: list
    parameters: int
    rmse: float
    behind: float
    chosen: bool


@dataclasses.dataclass(frozen=True)
class Evidence:
    """What a diagnosis rests on.

    Attributes
    ----------
    axis : {"x", "y", "z"}
    sampling_rate_hz : float
    samples, valid, used : int
        All instants of the record, those in both topics, and those that count.
    held_out_share : float
    held_out_stretches : int
    has_temperature, moves_across : bool
        Whether a temperature was recorded; whether the reference moves across the axis.
    in_use : SensorModel
    left : Leftover
        What is left with the named causes.
    fitted_sets : int
        Number of sets of causes that were fitted.
    always : list of str
        Causes in every set: what the model in use leaves open.
    rivals : list of Rival
        The chosen set, the best others, and the model in use.
    signals : dict
        ``whole`` and, of longer records, ``close_up``, each with ``output`` and ``residual``: dicts
        of name (measured, model in use, extended model) to (time [s], values [output units]),
        thinned to at most `MOST_POINTS`; NaN where there is no sample.
    close_up_samples : int
    density : dict
        ``frequency_hz`` and the amplitude densities [output units/sqrt(Hz)] of ``output`` and
        ``residual`` (by model).
    by_size, by_time : dict
        Places ``x`` (the output's distance from its mean [output units], time [s]) and the
        residual's RMS ``rms`` by model.
    """

    axis: str
    sampling_rate_hz: float
    samples: int
    valid: int
    used: int
    held_out_share: float
    held_out_stretches: int
    has_temperature: bool
    moves_across: bool
    in_use: SensorModel
    left: Leftover
    fitted_sets: int
    always: list
    rivals: list
    signals: dict
    close_up_samples: int
    density: dict
    by_size: dict
    by_time: dict

    @classmethod
    def of(cls, engine, best, fitted, named):
        """Evidence for the causes that are named.

        Parameters
        ----------
        engine : Engine
        best, fitted : Fitted
            The best set of causes, and that of the extended model.
        named : dict of str to Effect
        """
        search, p = engine.search, engine.problem
        outputs, residuals = _compared(engine, fitted, named)
        measured = np.where(p.record.valid, p.recorded, np.nan)
        rows, record = engine.held_out_rows, p.record
        length = close_up(record.reference[:, p.axis])
        signals = {"whole": _signals(p.time, {"measured": measured, **outputs}, residuals)}
        if len(p.time) > 2 * length:
            part = strongest_stretch(np.where(p.used, p.recorded, 0.0), length)
            signals["close_up"] = _signals(p.time, {"measured": measured, **outputs}, residuals,
                                           part)
        across = np.ptp(np.delete(record.reference, p.axis, axis=1), axis=0)
        return cls(
            AXES[p.axis], float(record.sampling_rate_hz), len(record), int(record.valid.sum()),
            p.count, float(rows.mean()), int(np.sum(np.diff(rows.astype(int)) > 0)),
            record.temperature_c is not None, bool(across.any()), p.baseline, engine.left(fitted),
            len(search.fits), sorted(search.base), _rivals(engine, best), signals, int(length),
            _density(p, residuals), _by_size(p, residuals), _by_time(p, residuals))

    def draw(self, figure):
        """Signals and residuals into a matplotlib figure."""
        kinds = self.signals["whole"]
        for axes, (kind, by_name) in zip(figure.subplots(2, sharex=True), kinds.items()):
            for name, (time, values) in by_name.items():
                axes.plot(time, values, label=name, linewidth=0.8)
            axes.set_ylabel(f"{kind} [output units]")
            above(axes)
        axes.set_xlabel("time [s]")

    def as_dict(self):
        """As the result file has it."""
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return plain({**fields, "in_use": self.in_use.to_dict(),
                      "left": dataclasses.asdict(self.left),
                      "rivals": [dataclasses.asdict(rival) for rival in self.rivals]})

    @classmethod
    def from_dict(cls, data):
        """Inverse of `as_dict`.

        Raises
        ------
        KeyError, TypeError
            Where something is missing or there is too much.
        """
        return cls(**{
            **data, "in_use": SensorModel.from_dict(data["in_use"]),
            "left": Leftover(**data["left"]),
            "rivals": [Rival(**rival) for rival in data["rivals"]],
            "signals": {view: {kind: {name: tuple(map(_array, pair))
                                      for name, pair in by_name.items()}
                               for kind, by_name in kinds.items()}
                        for view, kinds in data["signals"].items()},
            **{name: _arrays(data[name]) for name in ("density", "by_size", "by_time")}})


def _array(values):
    return np.array(values, float)


def _arrays(entry):
    return _arrays_of(entry) if isinstance(entry, dict) else _array(entry)


def _arrays_of(mapping):
    return {name: _arrays(entry) for name, entry in mapping.items()}


def _compared(engine, fitted, named):
    """Outputs and residuals (NaN where a sample does not count) by model."""
    p, bare = engine.problem, engine.search.baseline
    outputs, residuals = {IN_USE: bare.output}, {IN_USE: bare.residual}
    if named or fitted.causes != bare.causes:
        output = fitted.output
        for effect in named.values():
            # read off the record, and not among those that were fitted
            if effect.cause not in fitted.effects:
                output = effect.simulate(output, p.simulator(p.axis).circumstances)
        outputs[EXTENDED], residuals[EXTENDED] = output, fitted.residual
    off = p.recorded - p.measured
    return outputs, {name: np.where(p.used, values + off, np.nan)
                     for name, values in residuals.items()}


def _signals(time, outputs, residuals, part=slice(None)):
    return {kind: {name: thinned(time[part], values[part], MOST_POINTS)
                   for name, values in by_name.items()}
            for kind, by_name in (("output", outputs), ("residual", residuals))}


def _density(p, residuals):
    size, share = segment(len(p.time), _SEGMENT), p.used.mean()

    def density(values):
        frequency, power = welch(np.nan_to_num(values), p.rate, "hann", size)
        return frequency, legible(np.sqrt(power / share))
    frequency, output = density(np.where(p.used, p.recorded, 0.0))
    return {"frequency_hz": legible(frequency), "output": output,
            "residual": {name: density(values)[1] for name, values in residuals.items()}}


def _by_size(p, residuals):
    size = np.abs(p.recorded[p.used] - p.recorded[p.used].mean())
    edges = np.r_[0.0, np.quantile(size, _CLASSES)]
    place = np.clip(np.searchsorted(edges, size, side="left") - 1, 0, len(_CLASSES) - 1)
    return _grouped(place, size, p, residuals)


def _by_time(p, residuals):
    place = np.arange(len(p.time))[p.used] * _BLOCKS // len(p.time)
    return _grouped(place, p.time[p.used], p, residuals)


def _grouped(place, values, p, residuals):
    """Mean of the values and RMS of each residual in every group with enough samples."""
    count = np.bincount(place)
    kept = count >= min(_FEWEST, count.max())

    def mean(of):
        return np.bincount(place, of)[kept] / count[kept]
    return {"x": legible(mean(values)),
            "rms": {name: legible(np.sqrt(mean(residual[p.used]**2)))
                    for name, residual in residuals.items()}}


def _rivals(engine, best):
    """The chosen set, those that describe the record best, and the model in use, as `Rival`."""
    search, samples = engine.search, engine.problem.count
    bare = search.baseline
    others = sorted((fit for fit in search.fits.values()
                     if fit.causes not in (best.causes, bare.causes)), key=lambda fit: fit.cost)
    shown = [best, *others[:_MOST_RIVALS], *([bare] if bare is not best else [])]
    return [Rival(sorted(fit.causes - set(search.base)), len(fit.unknowns),
                  float(np.sqrt(fit.cost / samples)), float(engine.margin(fit, best)),
                  fit is best) for fit in shown]
