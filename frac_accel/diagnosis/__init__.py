"""What a simulation gets wrong, which cause explains it, and what the extended model gains."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from ..budget.reference_noise import reference_noise
from ..errors import FracAccelError
from ..identification.checks.record_checks import moving_samples
from ..io.bag import RAW_TOPIC, REFERENCE_TOPIC, TEMPERATURE_TOPIC
from ..model import AXES, SensorModel
from ..record import Record
from ..record.sources import pair_of, temperature_of
from .engines import Engines
from .finding import Diagnosis, Finding, insufficient
from .flat import with_rival
from .judgement import judge
from .model_in_use import FEWEST, classical, stated_of, too_poor
from .off_clock import put_back
from .once_more import beside_all_else, noise_behind_a_filter, with_slips
from .prepared import in_axes_of_reference, stated_noise, with_limits, with_motion
from .relation import require_relation
from .screened import screened
from .spikes import spikes_words
from .stages import CHECKED, IDENTIFIED, JUDGED, Stages
from .time_limit import TimeLimit
from .turned import with_turn

__all__ = ["Diagnosis", "Finding", "diagnose"]


# a trial that overflows has lost
@np.errstate(over="ignore", invalid="ignore")
def diagnose(source: Any, model: SensorModel | None = None, axis: str = "x",
             temperature: tuple | str | None = TEMPERATURE_TOPIC,
             reference: str = REFERENCE_TOPIC, sensor: str = RAW_TOPIC,
             progress: Callable | None = None,
             noise_std: float | None = None, time_limit_s: float = float("inf"),
             sampling_rate_hz: float | None = None, screening: bool = False) -> Diagnosis:
    """Find what a simulation gets wrong, and why.

    Parameters
    ----------
    source : str, Path or tuple
        A bag, or (reference, sensor) as `Samples` or as arrays of shape (n,) or (n, 3).
    model : SensorModel, optional
        The model in use; without it a classical one is identified first.
    axis : {"x", "y", "z"}
    temperature : tuple of ndarray, or str, optional
        Stamps [ns] and temperatures [°C]; or the topic that holds them, where `source` is a bag.
    reference, sensor : str
        Topics, where `source` is a bag.
    progress : callable, optional
        Called in each step with a few words and the share that is about done.
    noise_std : float, optional
        Standard deviation of the sensor's noise [output units], where it is known.
    time_limit_s : float
        Budget of processor time [s]; what it leaves out is said in `Diagnosis.cut_off`.
    sampling_rate_hz : float, optional
        Of arrays [Hz].
    screening : bool
        Also tell what each cause would be on its own, to first order (`Diagnosis.screened`).

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
    if noise_std is not None and not (np.isfinite(noise_std) and noise_std > 0):
        raise FracAccelError(f"noise_std: {noise_std} given, expected a number above 0")
    limit = TimeLimit(time_limit_s)
    stages = Stages(progress, limit)
    if isinstance(temperature, str):
        temperature = temperature_of(source, temperature)
    source = pair_of(source, sampling_rate_hz, axis, reference, sensor)
    column, is_stated = AXES.index(axis), model is not None
    stages.enter("checking the data", CHECKED)
    record = Record.of(*source, axis, temperature)
    record, source, orientation, turned = in_axes_of_reference(
        record, source, axis, temperature, model)
    model = model and record.as_laid_out(model)
    found = record.integrity(column)
    found.words.extend(turned)
    if len(record) < FEWEST:
        return insufficient(f"only {len(record)} samples; {FEWEST} needed", model, found)
    record, moving, words = with_motion(record, column)
    found.words.extend(words)
    used = record.valid & moving
    found = with_limits(found, record, column, used)
    noise_by = functools.partial(reference_noise, record, column, used,
                                 stated_noise(source[0], column))
    engines = Engines(record, column, moving, found,
                      noise_by(model and model.axis(axis).transfer_function), stages)
    poor = too_poor(record, column, engines.used, model)
    if poor:
        return insufficient(poor, model, engines.found)
    stds, seed, rival = stated_of(model, axis) if model else {}, None, None
    if not is_stated:
        stages.enter("identifying a classical model", IDENTIFIED)
        model, stds, seed, rival = classical(record, axis, engines.used, limit)
    begin, engine = engines.ready(model, stds, seed)
    if engines.noise is None and (noise := noise_behind_a_filter(engine, noise_by)):
        engines.know(noise)
        begin, engine = engines.ready(model, stds, seed)

    def identified_without(slips):
        whole = Record.of(source[0], put_back(source[1], slips), axis, temperature)
        return classical(whole, axis, whole.valid & moving_samples(whole, column)[0], limit)
    begin, engine, (*_, seed, rival), shown = with_slips(
        begin, engine, (model, stds, seed, rival), engines.shown, engines.ready,
        None if is_stated else identified_without)
    if engine.spikes.any():
        engines.found.words.append(spikes_words(engine.spikes.sum()))
    require_relation(engine, axis, seed)
    engine, best = beside_all_else(begin, engine, seed, record,
                                   None if is_stated else engines.begin)
    stages.enter("judging what was found", JUDGED)
    judged = with_rival(judge(engine, best, engines.found, shown, noise_std), rival)
    if orientation:
        judged = with_turn(judged, engine, orientation)
    return dataclasses.replace(judged, screened=screened(engine)) if screening else judged
