"""The search once more, beside what else a record turns out to have."""

import contextlib
import dataclasses
import functools

import numpy as np

from ..errors import FracAccelError
from ..model import AXES, SensorModel
from ..model.core import Gain, Oscillator
from .courses import about_zero, begun_with, beside, course_of, is_a_law, is_worth_it, refined
from .doubts.delays import undone_mounts
from .event import event, start
from .flat import (
    by_its_lead_a_mount,
    is_a_mount,
    links_beside_core,
    one_filter_instead,
    own_resonance_instead,
)
from .model_in_use import CORE
from .off_clock import are_lost, clock_of, slips_of
from .other_axes import beside_same_laws, may_be_unlike
from .read_off import drowned
from .search import is_nonlinear
from .seen import added, by_sample
from .sprung import as_the_sensor, beside_spring, is_better, may_hide_one, oscillator_of
from .stretches import Stretches

# Filters of which the best stands beside a course while that is found.
_FILTERS = 3
# Times that a model is identified with lost samples in their places.
_IDENTIFIED_AGAIN = 2
# Times that all else is looked for without what is known of each sample, and the shares of what is
# left (RMS) that this must be, and by which it must differ from what was known before.
_KNOWN_AGAIN, _KNOWN, _KNOWN_BETTER = 6, 0.7, 0.05
# Share of the power that common causes leave which a filter may leave for its response to be known.
_MOST_LEFT = 0.2


def beside_all_else(begin, engine, seed, record, engine_of):
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
    own_begin, other = _with_courses(engine_of(model, dict.fromkeys(CORE, np.inf), own_seed),
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
        own_begin, other = _with_courses(engine_of(model, dict.fromkeys(CORE, np.inf), {}),
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
    return engine_of(flat, dict.fromkeys(CORE, np.inf), {})


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


def with_slips(begin, engine, own, shown, ready, identified_without):
    """Engine whose every fit has the samples that are lost while the stamps count on, of a model
    that was identified with these in their places, what begins it, what was identified, and what
    the record shows by itself; those given where nothing is lost.

    Parameters
    ----------
    begin, engine : callable and Engine
    own : tuple
        As from `classical`.
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
    leaves more. Arguments as those of `with_slips`."""
    clock, left = clock_of(engine)
    if clock:
        with contextlib.suppress(FracAccelError):
            found = identified_without(clock)
            other_begin, other = ready(*found[:3])
            if clock_of(other)[1] < left:
                return other_begin, other, found
    return begin, engine, own


def _beside(begin, engine, hidden=np.False_):
    """The same engine, without some samples that count where asked."""
    other = begin(used=engine.wanted & ~hidden)
    other.at_limit, other.identified, other.found = engine.at_limit, engine.identified, engine.found
    other.spikes, other.aside = engine.spikes, engine.aside
    other.search.courses, other.as_the_sensor = engine.search.courses, engine.as_the_sensor
    return other


def noise_behind_a_filter(engine, noise_by):
    """`ReferenceNoise` that shows beside a filter which the model in use lacks and which takes most
    of what is left, by a function of a response; or None."""
    common = engine.everyday()
    fits = engine.search.with_a_filter(common, 1)
    if not fits or fits[0].cost > _MOST_LEFT * common.cost:
        return None
    return noise_by(engine.problem.axis_model(fits[0].effects).transfer_function)
