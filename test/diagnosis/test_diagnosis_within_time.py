"""What a search does with the time that it has: what joins, what is left out, and whose rivals."""

from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
import scipy.signal as sig
from rig.hidden import draw_case
from searched import searched as of_case

import frac_accel
from frac_accel.diagnosis import search as search_module
from frac_accel.diagnosis.engine import Engine
from frac_accel.diagnosis.problem import Problem
from frac_accel.diagnosis.search import Search
from frac_accel.diagnosis.time_limit import TimeLimit
from frac_accel.model.core import Gain
from frac_accel.model.effects import known_effects
from frac_accel.record import Record
from frac_accel.record.sources import pair_of

RATE = 200.0
N = 6000
EFFECTS = known_effects()
MODEL = frac_accel.SensorModel(Gain(1.0))


class Clock(TimeLimit):
    """A limit of 100 s of which as much is spent as it is told."""

    def __init__(self, spent=0.0):
        super().__init__(100.0)
        self.spent = spent

    def spent_s(self):
        return self.spent


def record(seed):
    """Three axes of which the second shows a little in the first, with a lag and a gain."""
    rng = np.random.default_rng(seed)
    motion = sig.sosfiltfilt(sig.butter(4, rng.uniform(20, 40), fs=RATE, output="sos"),
                             rng.normal(size=(N, 3)), axis=0)
    lines = np.fft.rfft(motion, axis=0)
    hertz = np.fft.rfftfreq(N, 1 / RATE)[:, None]
    late = np.fft.irfft(lines / (1 + 1j * hertz / rng.uniform(20, 60)), N, axis=0)
    sensor = late.copy()
    sensor[:, 0] = rng.uniform(0.9, 0.95) * late[:, 0] + rng.uniform(0.1, 0.15) * late[:, 1]
    sensor += 0.01 * np.std(motion) * rng.normal(size=sensor.shape)
    return Record.of(*pair_of((motion, sensor), RATE, "x", "", ""), "x", None)


def searched(seed, limit):
    rec = record(seed)
    problem = Problem(rec, 0, MODEL, np.ones(N, bool), limit)
    return Search(problem, candidates=[cause for cause, effect in EFFECTS.items()
                                       if not effect.read_off and effect.acts_on(Gain(1.0))])


def sets():
    return [{"low_pass_lag": EFFECTS["low_pass_lag"](30.0)},
            {"time_delay": EFFECTS["time_delay"](0.004)},
            {"sensitivity_error": EFFECTS["sensitivity_error"](0.95)}]


def test_once_its_time_is_over_a_round_finishes_only_its_best_trial():
    limit = Clock()
    search = searched(1, limit)
    tried = search.problem.fit

    def fit(*arguments, **options):
        fitted = tried(*arguments, **options)
        limit.spent += 25.0  # after the third trial, no time is left
        return fitted
    search.problem.fit = fit
    best, = search.fit_all(sets())
    assert best.causes == {"low_pass_lag"} and not best.rough
    assert "some sets of causes were not tried" in limit.left_out


def test_what_a_set_may_do_without_is_fitted_all_the_same():
    whole, late = searched(2, None), searched(2, Clock(70.0))
    effects = {**sets()[0], **sets()[2]}
    for search in (whole, late):
        fitted = search.fit(effects)
        search.problem.calls = 0
        search.less = search.without(fitted, "low_pass_lag", 1.1 * fitted.cost)
    assert late.less.cost == whole.less.cost
    assert late.problem.calls == whole.problem.calls  # no more than where there is time
    assert not late.problem.limit.left_out


def engine_of(limit):
    engine = Engine(record(3), 0, MODEL, np.ones(N, bool), limit=limit,
                    candidates=searched(3, None).candidates)
    best = engine.search.fit({**sets()[0], **sets()[2],
                              "cross_axis_sensitivity": EFFECTS["cross_axis_sensitivity"](0, 0.1)})
    return engine, best


def test_rivals_have_time_of_their_own_when_that_of_the_search_is_over():
    engine, best = engine_of(Clock(70.0))
    assert engine.problem.limit.ends_search()
    assert engine.compete(best).causes >= {"low_pass_lag"}
    assert not engine.uncontested and not engine.problem.limit.left_out
    rivals = [fit for fit in engine.search.fits.values() if "low_pass_lag" not in fit.causes]
    assert len(rivals) > 3  # and the strongest cause has met them
    assert engine.problem.limit.ends_search()  # what joins a set still has not


def test_the_strongest_cause_meets_its_rivals_first():
    limit = Clock(70.0)
    engine, best = engine_of(limit)
    screen = engine.search.screen

    def screened(fitted):
        limit.spent = 84.0 if limit.spent == 70.0 else 90.0  # the first one's are still in time
        return screen(fitted)
    engine.search.screen = screened
    engine.compete(best)
    strength = {cause: engine.rms(engine.added(best, cause)) for cause in best.effects}
    assert max(strength, key=strength.get) == "low_pass_lag" not in engine.uncontested
    # a gain needs none to have a name
    assert engine.uncontested == {"cross_axis_sensitivity"} < best.causes
    assert "sensitivity_error" in best.causes


def test_two_sets_that_only_mix_the_axes_otherwise_are_one_that_grows():
    search = searched(4, None)
    small = {"cross_axis_sensitivity": EFFECTS["cross_axis_sensitivity"](0, 0.1)}, \
        {"misalignment": EFFECTS["misalignment"](0.0, 0.0, -6.0)}
    # a filter of one axis would tell them apart
    begun = sets()[2]
    crossed, turned, plain = (search.fit({**begun, **more}) for more in (*small, {}))
    search.problem.limit = Clock()
    assert search._say_the_same(crossed, turned)
    assert search._that_differ([crossed, turned, plain]) == [crossed, plain]
    assert search._that_differ([turned, crossed, plain]) == [turned, plain]


@pytest.mark.parametrize("seed", range(4))
def test_what_is_held_to_be_needed_is_needed(seed):
    """Whatever is not fitted without a cause would have lain above the goal."""
    search = searched([5, seed], None)
    rng = np.random.default_rng(seed)
    names = ["offset", "quadratic_stiffness"][:rng.integers(3)]
    best = search.fit({**sets()[0], **sets()[2], **sets()[1],
                       "cross_axis_sensitivity": EFFECTS["cross_axis_sensitivity"](0, 0.1),
                       **{name: EFFECTS[name](0.01) for name in names}})
    goal = best.cost * (1 + 30 / search.problem.count)
    needed = {cause for cause in best.effects if search._is_needed(best, cause, goal)}
    assert needed and names == [name for name in names if name not in needed]
    for cause in needed:
        assert search.without(best, cause).cost > goal


@pytest.mark.parametrize("seed", range(4))
def test_a_filter_that_joins_a_delay_begins_no_later_than_both(seed):
    """It stood beside all of the delay that had stood for it, too late by as much as it is late,
    and a trial of a few steps did not come back."""
    search = searched(seed, Clock())
    delayed = search.fit({"time_delay": EFFECTS["time_delay"](0.004)})
    begun = {cause: search.begun(delayed, cause, begin)
             for _, cause, begin in search.screen(delayed)}
    filters = {"low_pass_lag", "linear_phase_filter", "low_pass_filter"} & begun.keys()
    assert filters
    for cause in filters:
        assert search.problem.cost(begun[cause]) < 1.2 * delayed.cost


@pytest.mark.parametrize("spent", [0.25, 0.1])
def test_a_set_that_leaves_little_grows_no_more_once_its_share_of_the_time_is_used_up(spent):
    """What the noise's colour lets in as steps and tones took the time in which names are made."""
    limit = Clock(100.0 * spent)
    search = searched(1, limit)
    with mock.patch.object(search_module, "_HARDLY", 1.0):
        grown = search.grow([{}], lambda fit: 0.0, lambda *_: True, lambda fit: False, 2)
    assert len(grown.causes) == (1 if spent > 0.2 else 2)
    assert ("was not looked for" in str(limit.summary())) == (spent > 0.2)


@pytest.mark.thorough
def test_what_is_not_needed_beside_a_force_is_left_out_at_once():
    """One by one took as many fits as there are pairs, each simulated step by step."""
    _, engine, best = of_case(draw_case(9_990_001, ["quadratic_damping", "offset_step"]))
    search = engine.search
    more = {"sensitivity_error": EFFECTS["sensitivity_error"](1.0001),
            "time_delay": EFFECTS["time_delay"](1e-6), "offset": EFFECTS["offset"](1e-5),
            "tone_interference": EFFECTS["tone_interference"](31.0, 1e-4, 0.3)}
    wide = search.fit({**best.effects, **more})
    search.fits = {wide.causes: wide}
    with mock.patch.object(search.problem, "fit", wraps=search.problem.fit) as fitted:
        pruned = search.prune(wide, engine.threshold)
    assert pruned.causes == {"quadratic_damping", "offset_step"}
    assert fitted.call_count < 4


def test_what_promises_most_is_tried_beside_what_is_not_screened():
    """Beside a force a screening takes long; what it would begin with is known from other fits."""
    linear, forced, has_it = (SimpleNamespace(causes=frozenset(causes)) for causes in (
        {"offset"}, {"offset", "coulomb_friction"}, {"coulomb_friction", "time_step"}))
    search = SimpleNamespace(_starts={(linear.causes, "time_step"): "its start"})
    wanted = {frozenset({"offset", "time_step"}): (1.0, linear, "time_step", "begins so"),
              frozenset({"offset", "gain_step"}): (2.0, linear, "gain_step", "or so")}
    found = Search._as_beside_others(search, [forced, has_it], wanted)
    assert found == {forced.causes | {"time_step"}: (1.0, forced, "time_step", "begins so")}
    assert search._starts[forced.causes, "time_step"] == "its start"
    assert Search._as_beside_others(search, [], {}) == {}
