"""What a simulation gets wrong, which cause explains it, and what the extended model gains."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..bag import RAW_TOPIC, REFERENCE_TOPIC
from ..core import Oscillator
from ..effects import known_effects
from ..errors import FracAccelError, IdentificationError
from ..identification.excitation import learning_length, require_excitation
from ..identification.record_checks import moving_samples
from ..model import AXES, SensorModel
from ..pair import Pair
from ..simulation import AxisSimulator
from ..sources import pair_of
from . import integrity
from .engine import Engine
from .judgement import Diagnosis, Finding, insufficient, judge
from .leftover import related
from .record import Record

__all__ = ["Diagnosis", "Finding", "diagnose"]

_FEWEST = 512
# Coefficients of a classical core with its delay: what the excitation must at least be good for.
_COEFFICIENTS = 4
# Share of its power in which a signal must follow the model the wrong way round, and the share of
# what is left the right way round that may be left then, for the pair to count as exchanged.
_ALIKE = 0.5
_EXCHANGED = 0.3
# Parameters of a classical core.
_CORE = ("natural_frequency_hz", "damping_ratio", "sensitivity")


def diagnose(source: Any, model: SensorModel | None = None, axis: str = "x",
             temperature: tuple | None = None, reference: str = REFERENCE_TOPIC,
             sensor: str = RAW_TOPIC, progress: Callable | None = None,
             sampling_rate_hz: float | None = None) -> Diagnosis:
    """Find what a simulation gets wrong, and why.

    Parameters
    ----------
    source : str, Path or tuple
        A bag, or (reference, sensor) as `Samples` or as arrays of shape (n,) or (n, 3).
    model : SensorModel, optional
        The model in use; without it a classical one is identified first.
    axis : {"x", "y", "z"}
    temperature : tuple of ndarray, optional
        Stamps [ns] and temperatures [°C].
    reference, sensor : str
        Topics, where `source` is a bag.
    progress : callable, optional
        Called with a few words before each step.
    sampling_rate_hz : float, optional
        Of arrays [Hz].

    Returns
    -------
    Diagnosis

    Raises
    ------
    FracAccelError
        If the record cannot be used, the sensor does not follow the reference, or no classical
        model can be identified although the excitation would do; if arrays are no pair: wrong
        shapes, values that are not finite, or no rate.

    Examples
    --------
    >>> import frac_accel
    >>> found = frac_accel.diagnose("bags/soft_mount.mcap",
    ...                             frac_accel.SensorModel.load("bags/soft_mount.yaml"))
    >>> [finding.cause for finding in found.findings]
    ['time_delay', 'cubic_stiffness']
    """
    progress = progress or (lambda words: None)
    pair = pair_of(source, sampling_rate_hz, axis, reference, sensor)
    column = AXES.index(axis)
    progress("checking the data")
    record = Record.of(pair[0], pair[1], axis, temperature)
    found = integrity.check(pair[1], record.sampling_rate_hz, column)
    if len(record) < _FEWEST:
        return insufficient(f"the record has {len(record)} samples, expected at least {_FEWEST}",
                            model, found)
    moving, notes = moving_samples(record.reference[:, column], record.sensor[:, column], record)
    found.words.extend(notes)
    shown = _shown(found, record.sensor[:, column])
    used = record.valid & moving
    for effect in shown.values():
        used &= ~effect.spoiled(record.sensor[:, column])
    split = learning_length(record.reference[:, column])
    for rows, part in ((used[:split], "before"), (used[split:], "after")):
        if rows.sum() < _FEWEST // 4:
            return insufficient(f"{rows.sum()} samples count {part} the instant that parts "
                                f"learning from judging, expected at least {_FEWEST // 4}",
                                model, found)
    seed = None
    if model is None:
        progress("identifying a classical model")
        try:
            require_excitation(record.reference[:, column], record.sampling_rate_hz, _COEFFICIENTS)
        except IdentificationError as error:
            return insufficient(str(error), model, found)
        model, stds, seed = _classical(record, axis, used)
    else:
        stds = _stated(model, axis)
    # the common lag of the stamps is a median of scattered ones
    loose = _left_open(model.axis(axis), stds, 1.25 * found.jitter_rms_s / np.sqrt(found.samples))
    engine = Engine(record, column, model, used,
                    {cause: entry.effect for cause, entry in loose.items()},
                    [cause for cause, effect in known_effects().items()
                     if not effect.read_off], progress, found.step)
    _require_relation(engine, axis, seed)
    return judge(engine, engine.run(seed), found, shown, loose, pair[1])


def _shown(found, measured):
    """Causes that the record shows by itself."""
    effects = {cause: effect.of_record(found, measured)
               for cause, effect in known_effects().items() if effect.read_off}
    return {cause: effect for cause, effect in effects.items() if effect is not None}


def _classical(record, axis, used):
    """Classical core identified from the record, what it knows of it (nothing, since any cause has
    bent it), and the effects that it was identified with."""
    from ..identification import identify
    pair = Pair(record.sampling_rate_hz, record.reference, record.sensor, used, record.lag_s,
                record.start_ns, float("nan"))
    model = identify(pair, axis, "oscillator").model
    return (SensorModel(model.core), dict.fromkeys(_CORE, np.inf),
            {effect.cause: effect for effect in model.effects})


def _stated(model, axis):
    """Standard uncertainties that a model states of its core, delay and offset."""
    own = model.axis(axis)
    stated = model.metadata.get("uncertainties")
    if not isinstance(stated, dict) or not isinstance(own.core, Oscillator) \
            or own.core.damping_order != 1 or any(effect.restates_core for effect in own.effects):
        return {}
    return {name: entry["std"] for name, entry in stated.items()
            if isinstance(entry, dict) and isinstance(entry.get("std"), (int, float))
            and np.isfinite(entry["std"]) and entry["std"] > 0}


def _left_open(own, stds, stamps_std_s):
    """Causes that stay free in every fit, since model and stamps leave them open."""
    effects = {cause: effect.left_open(own, stds, stamps_std_s)
               for cause, effect in known_effects().items()}
    return {cause: entry for cause, entry in effects.items() if entry is not None}


def _require_relation(engine, axis, seed):
    """Refuse a sensor that does not follow the reference."""
    p = engine.problem
    start = p.simulate({**engine.search.base, **(seed or {})})
    _require_direction(engine, axis, start)
    follows, share = related(p.measured, start, p.used)
    if follows:
        return
    hint = ""
    for other in range(3):
        if other != p.axis and np.ptp(p.record.reference[:, other]):
            simulated = p.simulator(other).simulate(p.baseline.axis(other))
            elsewhere, more = related(p.measured, simulated, p.used)
            if elsewhere and more > 2 * share:
                hint = f"; it follows the reference's {AXES[other]}: the axes are exchanged"
    raise FracAccelError(f"axis {axis}: the sensor does not follow the reference (they share "
                         f"{max(share, 0):.2%} of the power); they do not belong together{hint}")


def _require_direction(engine, axis, start):
    """Refuse a pair that the model fits far better the other way round."""
    p = engine.problem
    reference, used = p.record.reference[:, p.axis], p.used
    swapped = AxisSimulator(p.measured, p.rate, p.record.temperature_c)
    backward = _shared(reference, swapped.simulate(p.baseline.axis(p.axis)), used)
    if backward > _ALIKE and 1 - backward < _EXCHANGED * (1 - _shared(p.measured, start, used)):
        raise FracAccelError(
            f"axis {axis}: reference and sensor are exchanged: the reference follows the model's "
            f"answer to the sensor ({backward:.1%} of its power), and not the other way round; "
            "exchange the topics of --reference and --sensor")


def _shared(one, other, used):
    """Square of the correlation of two signals where they count."""
    one, other = one[used] - one[used].mean(), other[used] - other[used].mean()
    return float((one @ other)**2 / max((one @ one) * (other @ other), 1e-300))
