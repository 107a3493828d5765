"""What a simulation gets wrong, which cause explains it, and what the extended model gains."""

import contextlib
import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.ndimage import binary_erosion

from ..budget.reference_noise import reference_noise
from ..errors import FracAccelError, IdentificationError
from ..identification.checks.clipped import clipped_sensor
from ..identification.checks.record_checks import moving_samples, unclipped_reference
from ..identification.response.excitation import held_out_of, require_excitation
from ..io.bag import RAW_TOPIC, REFERENCE_TOPIC, TEMPERATURE_TOPIC
from ..model import AXES, SensorModel
from ..model.core import Gain, Oscillator
from ..model.effects import known_effects
from ..model.effects.base import INTERFERENCE
from ..record import Record
from ..record.clipping import at_limits
from ..record.orientation import Orientation, turned_away
from ..record.sources import pair_of, temperature_of
from ..simulation import AxisSimulator
from .courses import about_zero, begun_with, beside, course_of, is_a_law, is_worth_it, refined
from .doubts.delays import undone_mounts
from .engine import Engine
from .event import event, start
from .finding import Diagnosis, Finding, insufficient
from .flat import (
    by_its_lead_a_mount,
    flat_instead,
    is_a_mount,
    links_beside_core,
    one_filter_instead,
    own_resonance_instead,
    with_rival,
)
from .judgement import judge
from .leftover import related
from .off_clock import are_lost, clock_of, put_back, slips_of
from .other_axes import OtherAxes, beside_same_laws, may_be_unlike
from .read_off import drowned
from .screened import screened
from .search import is_nonlinear
from .seen import added, by_sample
from .spikes import spikes, spikes_words
from .sprung import as_the_sensor, beside_spring, is_better, may_hide_one, oscillator_of
from .stages import CHECKED, IDENTIFIED, JUDGED, Stages
from .stretches import MOST, Stretches, strongest_part
from .time_limit import TimeLimit
from .turned import with_turn

__all__ = ["Diagnosis", "Finding", "diagnose"]

_FEWEST = 512
# Coefficients of a classical core with its delay: what the excitation must at least be good for.
_COEFFICIENTS = 4
# Samples around one that does not count whose residual is not searched for spikes.
_EDGE = 4
# Share of its power in which a signal must follow the model the wrong way round, and the share of
# what is left the right way round that may be left then, for the pair to count as exchanged.
_ALIKE = 0.5
_EXCHANGED = 0.3
# Share of its power in which a sensor must follow the reference at some frequencies or other, for
# causes to be looked for where no classical sensor can be identified.
_FOLLOWS = 0.5
# Causes that are tried before a pair counts as exchanged.
_TRIED = 4
# Filters of which the best stands beside a course while that is found.
_FILTERS = 3
# Share of the record in which the reference may be clipped: what is found is judged, and what it
# leaves there shows.
_CLIPPED_REFERENCE = 0.02
# Times that a model is identified with lost samples in their places.
_IDENTIFIED_AGAIN = 2
# Times that all else is looked for without what is known of each sample, and the shares of what is
# left (RMS) that this must be, and by which it must differ from what was known before.
_KNOWN_AGAIN, _KNOWN, _KNOWN_BETTER = 6, 0.7, 0.05
# Share of the power that common causes leave which a filter may leave for its response to be known.
_MOST_LEFT = 0.2
# Parameters of a classical core.
_CORE = ("natural_frequency_hz", "damping_ratio", "sensitivity")


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
    column = AXES.index(axis)
    stages.enter("checking the data", CHECKED)
    record = Record.of(*source, axis, temperature)
    record, source, orientation, turned = _in_axes_of_reference(
        record, source, axis, temperature, model)
    model = model and record.as_laid_out(model)
    found = record.integrity(column)
    found.words.extend(turned)
    if len(record) < _FEWEST:
        return insufficient(f"only {len(record)} samples; {_FEWEST} needed", model, found)
    moving, notes = moving_samples(record, column)
    unclipped, more = unclipped_reference(record, column, moving, _CLIPPED_REFERENCE)
    # what moved there nobody knows: no budget parts it either
    record = dataclasses.replace(record, valid=record.valid & (unclipped | ~moving))
    moving = unclipped
    found.words.extend([*notes, *more])
    used = record.valid & moving
    found = _with_limits(found, record, column, used)
    noise_by = functools.partial(reference_noise, record, column, used,
                                 _stated_noise(source[0], column))
    noise = noise_by(model and model.axis(axis).transfer_function)
    found = _with_noise(found, noise)
    shown, used, stray, at_limit = _shown(found, record, column, used)
    poor = _too_poor(record, column, used, model)
    if poor:
        return insufficient(poor, model, found)
    stds, seed, rival = _stated(model, axis) if model else {}, None, None
    is_stated = model is not None
    if not is_stated:
        stages.enter("identifying a classical model", IDENTIFIED)
        model, stds, seed, rival = _classical(record, axis, used, limit)

    def engine_of(model, stds, seed):
        # the common lag of the stamps is a median of scattered ones
        loose = _left_open(model.axis(axis), stds,
                           1.25 * found.jitter_rms_s / np.sqrt(found.samples))
        return functools.partial(
            Engine, record.comparable(column, used), column, model,
            base=_in_every_fit(loose, shown), candidates=_candidates(model.axis(axis).core),
            stages=stages, step=found.step, limit=limit,
            passed_on=None if noise and noise.bends else noise, loose=loose,
            others=OtherAxes(tuple(cause for cause, entry in loose.items()
                                   if seed is not None and entry.effect.restates_core),
                             alike=np.count_nonzero(np.ptp(record.reference, axis=0)) > 1))

    def ready(model, stds, seed):
        begin = engine_of(model, stds, seed)
        engine, spiked = _without_spikes(begin, used, stray, record.reference[:, column],
                                         found.step)
        engine.spikes, engine.aside = spiked, spiked | (record.valid & ~moving)
        engine.at_limit, engine.found = at_limit, found
        engine.identified = {cause: effect for cause, effect in (seed or {}).items()
                             if effect.everyday}
        return begin, engine
    begin, engine = ready(model, stds, seed)
    if noise is None:
        noise = _noise_behind_a_filter(engine, noise_by)
        if noise:
            found = _with_noise(found, noise)
            shown = _by_record(found, record.sensor[:, column])
            begin, engine = ready(model, stds, seed)

    def identified_without(slips):
        whole = Record.of(source[0], put_back(source[1], slips), axis, temperature)
        return _classical(whole, axis, whole.valid & moving_samples(whole, column)[0], limit)
    begin, engine, (*_, seed, rival), shown = _with_slips(
        begin, engine, (model, stds, seed, rival), shown, ready,
        None if is_stated else identified_without)
    if engine.spikes.any():
        found.words.append(spikes_words(engine.spikes.sum()))
    _require_relation(engine, axis, seed)
    engine, best = _beside_all_else(begin, engine, seed, record, None if is_stated else engine_of)
    stages.enter("judging what was found", JUDGED)
    judged = with_rival(judge(engine, best, found, shown, noise_std), rival)
    if orientation:
        judged = with_turn(judged, engine, orientation)
    return dataclasses.replace(judged, screened=screened(engine)) if screening else judged


def _beside_all_else(begin, engine, seed, record, engine_of):
    """Engine and its best set of causes, beside what else the record turns out to have: another
    core, where none is stated (else `engine_of` is None), other filters of the other axes, courses
    in time, and what drowns or is known of single samples."""
    begin, engine, best = _searched(begin, engine, seed)
    if engine_of is not None and may_hide_one(engine, best):
        begin, engine, best, seed = _with_a_spring(begin, engine, best, seed, engine_of, record)
    elif engine_of is not None:
        begin, engine, best, seed = _with_a_mount(begin, engine, best, seed, engine_of)
        begin, engine, best, seed = _with_a_filter(begin, engine, best, seed, engine_of)
    if engine_of is not None:
        begin, engine, best, seed = _with_own_resonance(begin, engine, best, seed, engine_of)
    begin, engine, best = _with_unlike_axes(begin, engine, best, seed)
    begin, engine, best = _with_same_laws(begin, engine, best)
    begin, engine, best = _with_a_course(begin, engine, best, seed)
    if engine.part is None:
        engine, best = _without_start(begin, engine, best)
    engine, best = _without_drowned(begin, engine, best, seed)
    return _without_known(begin, engine, best, seed)


def _with_limits(found, record, column, used):
    """`Integrity` with limits at which too few samples pile up to be certain by themselves, where
    a classical sensor, identified without them, goes beyond."""
    if record.resampled:
        return found
    measured = record.sensor[:, column]
    certain = (measured == found.lower) | (measured == found.upper)
    clipping = clipped_sensor(record.reference[:, column], measured, used & ~certain, found.step,
                              record.sampling_rate_hz, record.lag_s)
    if not clipping.samples.any():
        return found
    lower = clipping.lower if found.lower is None else found.lower
    upper = clipping.upper if found.upper is None else found.upper
    return dataclasses.replace(
        found, lower=lower, upper=upper,
        words=found.words + at_limits(measured[clipping.samples], clipping.lower, clipping.upper))


def _in_every_fit(loose, shown):
    """Effects by cause: what the model in use leaves open, and faults of the reference."""
    return {**{cause: entry.effect for cause, entry in loose.items()},
            **{cause: effect for cause, effect in shown.items() if effect.of_reference}}


def _candidates(core):
    """Causes that are fitted, of those that a sensor with a core can have."""
    return [cause for cause, effect in known_effects().items()
            if not effect.read_off and effect.acts_on(core)]


def _in_axes_of_reference(record, source, axis, temperature, model):
    """The record of a sensor whose axis follows another one, turned; its topics, `Orientation`
    (None where it was not turned), and words."""
    orientation = _orientation(record, model)
    if orientation is None or orientation.is_against_constants(record):
        return record, source, None, []
    opposes = orientation.opposes(axis, -1 if model and _inverts(model.axis(axis)) else 1)
    if model and opposes and not orientation.upside_down:
        return record, source, None, [
            f"the sensor's {axis} axis points the other way than the model says, or its polarity "
            "is reversed: a gain below zero says that"]
    if not (orientation.astray(axis) or (opposes and orientation.upside_down and (
            model or _reversed_as_identified(record, axis)))):
        return record, source, None, []
    try:
        source = source[0], orientation.turn(source[1])
        turned = Record.of(*source, axis, temperature)
    except FracAccelError:
        return record, source, None, []  # the refusal says which axis it follows
    return turned, source, orientation, [
        f"the sensor lies turned: {orientation.words}; what follows holds for its signal turned "
        "into the reference's axes"]


def _reversed_as_identified(record, axis):
    """Whether a classical sensor of a record has a gain below zero: above a resonance all axes look
    reversed, and are not."""
    from ..identification import identify
    try:
        part, _ = strongest_part(record, AXES.index(axis), record.valid, MOST)
        return _inverts(identify(part, axis, "classical").model.axis(axis))
    except IdentificationError:
        return True  # nothing speaks against the turn


def _orientation(record, model):
    """Orientation of a record's sensor; where it does not lie as its reference does, and there is a
    model, against what that makes of the reference if that explains more: a resonance may have
    most of the power, and above it all axes look reversed."""
    found = Orientation.of(record)
    if model is None or found is None or (any(map(found.followed, AXES)) and not found.words):
        return found
    try:
        # as the reference, a sensor that inverts has its own sign
        answer = [AxisSimulator(record.reference[:, i], record.sampling_rate_hz,
                                record.temperature_c).simulate(own) * (-1 if _inverts(own) else 1)
                  for i, own in enumerate(map(model.axis, AXES))]
    except FracAccelError:
        return found
    answered = Orientation.of(dataclasses.replace(record, reference=np.stack(answer, axis=1)))
    return max((one for one in (answered, found) if one is not None),
               key=lambda one: np.nansum(one.explained))


def _inverts(own):
    """Whether a model turns slow motion round."""
    return own.core.sensitivity < 0 if isinstance(own.core, (Gain, Oscillator)) else False


def _without_spikes(engine, used, stray, reference, step):
    """Engine whose fits leave out what stands out of the residual, too; and all that they do."""
    first = engine(used=used)
    # where samples do not count the residual is 0, and steps at their edges are no spikes
    p = first.problem
    inside = binary_erosion(p.used, iterations=_EDGE)
    more = p.put_back(inside & spikes(first.search.baseline.residual,
                                      p.taken(reference), step), np.zeros(len(used), bool))
    return (engine(used=used & ~more) if more.any() else first), stray | more


def _with_a_spring(begin, engine, best, seed, engine_of, record):
    """Engine with the oscillator that the gain of another one may hide, what begins and seeds it,
    and its best set; those given where it explains nothing more."""
    p = engine.problem
    if p.limit.ends_search("no oscillator was tried in the gain's place"):
        return begin, engine, best, seed
    found = oscillator_of(record, AXES[p.axis], engine.wanted)
    if found is None:
        return begin, engine, best, seed
    model, own_seed, damping = found
    own_begin, other = _with_courses(engine_of(model, dict.fromkeys(_CORE, np.inf), own_seed),
                                     engine, engine.search.courses)
    other.search.candidates = beside_spring(engine, best)
    own_best = other.run(own_seed)
    if is_better(engine, best, own_best, (other.part or other).noise_only(own_best)):
        return own_begin, other, own_best, own_seed
    engine.as_the_sensor = as_the_sensor(engine, best, own_best, damping)
    return begin, engine, best, seed


def _with_a_mount(begin, engine, best, seed, engine_of):
    """Engine with a gain on a mount in the place of the oscillator that was identified, what begins
    and seeds it, and its best set; those given where that is no mount by its lead. Beside what
    changes along the record neither was known when the oscillator was."""
    p = engine.problem
    cause = by_its_lead_a_mount(engine, best)
    if cause is None or p.limit.ends_search("no mount was tried in the sensor's place"):
        return begin, engine, best, seed
    own_begin, other = _with_courses(_flat(engine, engine_of), engine, engine.search.courses)
    own_seed = {name: effect for name, effect in best.effects.items()
                if name in other.search.candidates and name != cause}
    own_best = other.run(own_seed)
    if not is_a_mount(best, own_best):
        return begin, engine, best, seed
    return own_begin, other, own_best, own_seed


def _with_a_filter(begin, engine, best, seed, engine_of):
    """Engine with a gain behind one filter in the place of an oscillator that was identified and of
    links, what begins and seeds it, and its best set; those given where that is no leaner."""
    links = links_beside_core(engine, best)
    if not links or engine.part or engine.problem.limit.ends_search(
            "no filter was tried in the place of the sensor and its links"):
        return begin, engine, best, seed
    own_begin, other = _with_courses(_flat(engine, engine_of), engine, engine.search.courses)
    found = one_filter_instead(other, best, links)
    if found is None:
        return begin, engine, best, seed
    return _from(own_begin, other, found)


def _with_own_resonance(begin, engine, best, seed, engine_of):
    """Engine with an oscillator in the place of a gain, a mount and filters that undo the mount's
    zero, what begins and seeds it, and its best set; those given where that is no leaner."""
    p = engine.problem
    for cause in undone_mounts(engine, best) if engine.part is None else ():
        if p.limit.ends_search("no resonance of the sensor's own was tried in a mount's place"):
            break
        pole = best.effects[cause].poles()[0]
        omega = float(abs(pole))
        model = SensorModel(Oscillator(omega / (2 * np.pi), float(-pole.real) / omega,
                                       sensitivity=p.baseline.axis(p.axis).core.sensitivity))
        own_begin, other = _with_courses(engine_of(model, dict.fromkeys(_CORE, np.inf), {}),
                                         engine, engine.search.courses)
        found = own_resonance_instead(other, best)
        if found is not None:
            return _from(own_begin, other, found)
    return begin, engine, best, seed


def _from(begin, engine, found):
    """What begins an engine, that, its best set from one that was found, and what seeds it."""
    engine.best = engine.compete(engine.search.prune(found, engine.threshold))
    return begin, engine, engine.best, {cause: effect for cause, effect in
                                        engine.best.effects.items()
                                        if cause not in engine.search.base}


def _flat(engine, engine_of):
    """What begins an engine with a gain in the place of another one's core."""
    p = engine.problem
    flat = SensorModel(Gain(p.baseline.axes[p.axis].core.sensitivity))
    return engine_of(flat, dict.fromkeys(_CORE, np.inf), {})


def _searched(begin, engine, seed):
    """Engine, what begins it, and its best set of causes: beside what changes slowly before all
    else, if that leaves noise or far less than without."""
    courses = begun_with(engine)
    if not courses:
        return begin, engine, engine.run(seed)
    own_begin, other = _beside_a_course(begin, engine, courses, {})
    own_best = other.run(seed)
    if (other.part or other).noise_only(own_best):
        if not is_a_law(engine, own_best, courses):
            return own_begin, other, own_best
        best = engine.run(seed)
        return (own_begin, other, own_best) if own_best.cost < best.cost \
            else (begin, engine, best)
    best = engine.run(seed)
    return (own_begin, other, own_best) if is_worth_it(best, own_best, courses) \
        else (begin, engine, best)


def _with_slips(begin, engine, own, shown, ready, identified_without):
    """Engine whose every fit has the samples that are lost while the stamps count on, of a model
    that was identified with these in their places, what begins it, what was identified, and what
    the record shows by itself; those given where nothing is lost.

    Parameters
    ----------
    begin, engine : callable and Engine
    own : tuple
        As from `_classical`.
    shown : dict of str to Effect
    ready : callable
        (model, stds, seed) -> what begins an engine, and the engine.
    identified_without : callable or None
        (slips) -> as `own`; None where the model is stated.
    """
    def unknown(slips):
        return {cause: effect for cause, effect in slips.items() if cause not in shown}
    slips, other_begin, other, others = unknown(slips_of(engine)), begin, engine, own
    with contextlib.suppress(FracAccelError):
        for _ in range(_IDENTIFIED_AGAIN if slips and identified_without else 0):
            found = identified_without(slips)
            (other_begin, other), others = ready(*found[:3]), found
            again = unknown(slips_of(other, other.problem.simulate(
                {**other.search.base, **others[2]})))
            if again in ({}, slips):
                break
            slips = again
    if not slips or not are_lost(other, slips):
        if identified_without:
            begin, engine, own = _on_its_clock(begin, engine, own, ready, identified_without)
        return begin, engine, own, shown
    begin = functools.partial(other_begin, base={**other_begin.keywords["base"], **slips})
    return begin, _beside(begin, other), others, \
        {**shown, **slips}


def _on_its_clock(begin, engine, own, ready, identified_without):
    """Engine of a model that was identified with the stamps that a clock would have given which is
    not off, what begins it, and what was identified; those given where no clock is off, or that
    leaves more. Arguments as those of `_with_slips`."""
    clock, left = clock_of(engine)
    if clock:
        with contextlib.suppress(FracAccelError):
            found = identified_without(clock)
            other_begin, other = ready(*found[:3])
            if clock_of(other)[1] < left:
                return other_begin, other, found
    return begin, engine, own


def _with_unlike_axes(begin, engine, best, seed):
    """Engine for which the other axes have filters and dynamics of their own, what begins it, and
    its best set; those given, of axes that are alike, where that is clearly worse."""
    p = engine.problem
    if not may_be_unlike(engine, best) or p.limit.ends_search(
            "whether the other axes have other filters was not tried"):
        return begin, engine, best
    own_begin = functools.partial(begin, others=dataclasses.replace(p.others, alike=False))
    other = _beside(own_begin, engine)
    # most of what was found holds there, too: what does not is left out again
    own_best = other.run({cause: effect for cause, effect in best.effects.items()
                          if cause in other.search.candidates} or seed)
    if own_best.cost - best.cost > (engine.part or engine).threshold(best):
        return begin, engine, best
    return own_begin, other, own_best


def _with_same_laws(begin, engine, best):
    """Engine for which the other axes have the laws that were found on this one, what begins it,
    and its best set, where that says more; those given elsewhere."""
    effects = beside_same_laws(engine, best)
    if effects is None:
        return begin, engine, best
    begin = functools.partial(begin, others=dataclasses.replace(engine.problem.others,
                                                                same_laws=True))
    other = _beside(begin, engine)
    return begin, other, other.run(effects)


def _with_a_course(begin, engine, best, seed):
    """Engine that looks for all else beside courses in time, what begins it, and its best set;
    those given where nothing changes slowly."""
    courses = course_of(engine, best)
    if not courses or engine.problem.limit.ends_search(
            "nothing was looked for beside what changes slowly"):
        return begin, engine, best
    own_begin, other = _beside_a_course(begin, engine, courses, best.effects)
    own_best = other.run(seed)
    if not is_worth_it(best, own_best, courses):
        return begin, engine, best
    return own_begin, other, own_best


def _beside_a_course(begin, engine, courses, effects):
    """Engine whose every fit has these courses, found once more beside the fit of some effects (or
    of the common ones and a filter), and what begins it."""
    _, first = _with_courses(begin, engine, about_zero(courses))
    effects = {cause: effect for cause, effect in effects.items()
               if cause in first.search.candidates}
    if not effects:
        common = first.everyday()
        effects = min([common, *first.search.with_a_filter(common, _FILTERS)],
                      key=lambda fit: fit.cost).effects
    return _with_courses(begin, engine, refined(first, effects))


def _with_courses(begin, engine, courses):
    """Engine, otherwise as another one, whose every fit has these courses, and what begins it."""
    begin = functools.partial(begin, base={**begin.keywords["base"], **courses},
                              candidates=beside(courses, begin.keywords["candidates"]))
    other = _beside(begin, engine)
    other.search.courses = courses
    return begin, other


def _without_drowned(begin, engine, best, seed):
    """Engine whose fits leave out the samples in which what the record shows by itself, or what
    happened once, drowns all else, and its best set; those given where there are none."""
    if engine.part is not None and is_nonlinear(best):
        return engine, best  # the whole of it would take too long
    hidden = shown = drowned(engine, engine.on_whole(best), engine.found)
    if not hidden.any() and engine.part is None and len(engine.record) == len(best.residual):
        hidden = event(best.residual, engine.problem.measured, engine.problem.used)
    if not hidden.any():
        return engine, best
    other = _beside(begin, engine, hidden)
    # what the record shows by itself is looked at once more
    other.spikes, other.aside = engine.spikes | shown, engine.aside & ~hidden
    other.drowned = hidden
    return other, other.run(seed)


def _without_known(begin, engine, best, seed):
    """Engine whose fits see the sensor without what the record shows by itself of each sample, such
    as how old a value is that was polled, and its best set; those given where there is nothing."""
    first = engine, best
    for _ in range(_KNOWN_AGAIN):
        p = engine.problem
        if isinstance(p, Stretches) or p.limit.ends_search(
                "nothing was looked for beside what is known of each sample"):
            break
        fit = engine.on_whole(best)
        known = added(engine, fit)
        least = _KNOWN if engine is first[0] else _KNOWN_BETTER
        if np.std(known[p.used]) <= least * np.std(fit.residual[p.used]):
            break
        record, *rest = begin.args
        begin = functools.partial(begin.func, engine.record.without(p.axis, known), *rest,
                                  **begin.keywords)
        other = _beside(begin, engine)
        other.drowned, best = engine.drowned, other.run(seed)
        engine = other
    if engine is not first[0] and not by_sample(engine, engine.on_whole(best)).any():
        return first  # what was known does not show beside this set
    return engine, best


def _without_start(begin, engine, best):
    """Engine whose fits leave out how a strong force's motion begins, and its best set; those given
    where nothing stands out there."""
    early = start(engine, best)
    if not early.any():
        return engine, best
    engine.found.words.append(
        f"the first {early.sum() / engine.problem.rate:.2g} s count in no fit: how the mass moved "
        "before is not known, and with the forces that are found it is not forgotten sooner")
    other = _beside(begin, engine, early)
    return other, other.run({cause: effect for cause, effect in best.effects.items()
                             if cause not in engine.search.base})


def _beside(begin, engine, hidden=np.False_):
    """The same engine, without some samples that count where asked."""
    other = begin(used=engine.wanted & ~hidden)
    other.at_limit, other.identified, other.found = engine.at_limit, engine.identified, engine.found
    other.spikes, other.aside = engine.spikes, engine.aside
    other.search.courses, other.as_the_sensor = engine.search.courses, engine.as_the_sensor
    return other


def _with_noise(found, noise):
    """`Integrity` with the reference's noise, where that is enough to bend a fit."""
    if noise is None or not noise.bends:
        return found
    return dataclasses.replace(found, reference_noise=noise, words=[*found.words, noise.words])


def _noise_behind_a_filter(engine, noise_by):
    """`ReferenceNoise` that shows beside a filter which the model in use lacks and which takes most
    of what is left, by a function of a response; or None."""
    common = engine.everyday()
    fits = engine.search.with_a_filter(common, 1)
    if not fits or fits[0].cost > _MOST_LEFT * common.cost:
        return None
    return noise_by(engine.problem.axis_model(fits[0].effects).transfer_function)


def _shown(found, record, column, used):
    """Causes that the record shows by itself; the samples that count with these; its spikes; and
    those that say nothing of other causes."""
    measured = record.sensor[:, column]
    effects = _by_record(found, measured)
    stray = used & spikes(measured, record.reference[:, column], found.step)
    silent = np.zeros(len(used), bool)
    for effect in effects.values():
        silent |= record.instants_of(effect.spoiled, column)
    return effects, used & ~stray & ~silent, stray, silent


def _by_record(found, measured):
    """Causes that the record shows by itself, as effects by cause."""
    effects = {cause: effect.of_record(found, measured)
               for cause, effect in known_effects().items()}
    return {cause: effect for cause, effect in effects.items() if effect is not None}


def _too_poor(record, column, used, model):
    """Words where a record holds too little to be judged, or, without a model, to identify one."""
    reference = record.reference[:, column]
    last = held_out_of(reference, used)
    for rows, part in ((used & ~last, "training"), (used & last, "held-out")):
        if rows.sum() < _FEWEST // 4:
            return f"only {rows.sum()} {part} samples; {_FEWEST // 4} needed"
    try:
        if model is None:
            require_excitation(reference, record.sampling_rate_hz, _COEFFICIENTS)
    except IdentificationError as error:
        return str(error)
    return None


def _classical(record, axis, used, limit):
    """Classical core (a gain where no resonance shows) identified from the record, what it knows
    of it (nothing, since any cause has bent it), the effects that it was identified with, and those
    that describe the record as well with a gain."""
    from ..identification import identify
    # all that is found here is fitted anew
    record, used = strongest_part(record, AXES.index(axis), used, MOST)
    stds = dict.fromkeys(_CORE, np.inf)
    try:
        found = identify(dataclasses.replace(record, valid=used), axis, "classical")
    except IdentificationError:
        gain = _gain_of_related(record, AXES.index(axis), used)
        if gain is None:
            raise
        return SensorModel(Gain(gain)), stds, {}, None
    core, seed = SensorModel(found.model.core), found.fitted_effects

    def opened(model):
        return {cause: entry.effect
                for cause, entry in _left_open(model.axis(axis), stds, 0.0).items()}
    rival = None
    if isinstance(core.core, Oscillator):
        core, seed, rival = flat_instead(record, AXES.index(axis), used, core, opened, seed, limit)
    return core, stds, seed, rival


def _gain_of_related(record, column, used):
    """Gain of fast motion where a sensor follows the reference through some filter, such as one
    that takes most of the motion away, though no classical sensor does; else None."""
    follows, share = _related_in_fast_motion(record.sensor[:, column], record.reference[:, column],
                                             used)
    if not follows or share < _FOLLOWS:
        return None
    answer, moved = (np.diff(values[:, column])[used[1:] & used[:-1]]
                     for values in (record.sensor, record.reference))
    return float(moved @ answer / max(moved @ moved, 1e-300)) or None


def _related_in_fast_motion(measured, expected, used):
    """As `related`, by what changes from sample to sample: slow motion, which a high-pass takes
    away, says nothing then."""
    both = used[1:] & used[:-1]
    return related(*(np.where(both, np.diff(values), 0.0) for values in (measured, expected)), both)


def _stated_noise(samples, column):
    """Standard deviation [m/s²] that the messages of a topic state, or NaN."""
    stated = samples.variance[:, column]
    return np.sqrt(np.nanmean(stated)) if np.isfinite(stated).any() else np.nan


def _stated(model, axis):
    """Standard uncertainties that a model states of its core, delay and offset."""
    own = model.axis(axis)
    stated = model.metadata.get("uncertainties")
    if not isinstance(stated, dict) or not isinstance(own.core, (Oscillator, Gain)) \
            or getattr(own.core, "damping_order", 1) != 1 \
            or any(effect.restates_core for effect in own.effects):
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
    if follows or _related_in_fast_motion(p.measured, start, p.used)[0]:
        return
    if _related_beside_interference(engine, start):
        return
    hint = turned_away(p.record, axis) or "they do not belong together"
    raise FracAccelError(f"axis {axis}: the sensor does not follow the reference (they share "
                         f"{max(share, 0):.2%} of the power); {hint}")


def _related_beside_interference(engine, start):
    """Whether a sensor follows the reference once what is louder than the motion, and has nothing
    to do with it, is taken off."""
    search, p = engine.search, engine.problem
    bare = search.baseline
    fits = search.fit_all([search.begun(bare, cause, begin) for _, cause, begin in
                           search.screen(bare) if begin.stage == INTERFERENCE])
    return any(related(p.measured - engine.added(fit, cause), start, p.used)[0]
               for fit in fits for cause in fit.causes - bare.causes)


def _require_direction(engine, axis, start):
    """Refuse a pair that the model fits far better the other way round."""
    p = engine.problem
    own = p.baseline.axis(p.axis)
    if isinstance(own.core, Gain) and not own.effects:
        return  # which answers alike either way
    reference, used = p.record.reference[:, p.axis], p.used
    swapped = AxisSimulator(p.measured, p.rate, p.record.temperature_c)
    backward = _shared(reference, swapped.simulate(p.baseline.axis(p.axis)), used)
    if backward > _ALIKE and 1 - backward < _EXCHANGED * (1 - _shared(p.measured, start, used)) \
            and _best_of_one(engine, p.measured, used) < backward:
        raise FracAccelError(
            f"axis {axis}: reference and sensor are exchanged: the reference follows the model's "
            f"answer to the sensor ({backward:.1%} of its power), and not the other way round; "
            "exchange the topics of --reference and --sensor")


def _best_of_one(engine, measured, used):
    """Share of the sensor's power that the model explains the right way round with one cause."""
    search = engine.search
    bare = search.baseline
    fits = search.fit_all([search.begun(bare, cause, begin)
                           for _, cause, begin in search.screen(bare)[:_TRIED]])
    return max((_shared(measured, fit.output, used) for fit in fits), default=0.0)


def _shared(one, other, used):
    """Square of the correlation of two signals where they count."""
    one, other = one[used] - one[used].mean(), other[used] - other[used].mean()
    return float((one @ other)**2 / max((one @ one) * (other @ other), 1e-300))
