"""The judge of the diagnosis counts right: perfect, wrong and silent diagnosers get their due."""

import numpy as np
import pytest
from blind import score
from blind.plan import GROUPS, plan
from blind.report import markdown
from blind.trial import run
from rig.hidden import draw_case
from scipy.special import expit

from frac_accel.errors import FracAccelError


def row(group, causes, findings=(), verdict="explained", **more):
    """Row as `trial.run` makes it, with findings without parameters."""
    return {"group": group, "name": "n", "seed": 0, "causes": tuple(causes), "error": None,
            "verdict": verdict, "findings": {cause: {} for cause in findings}, "truth": {},
            "samples": 24_000, "cpu_s": 1.0, "extended_rmse": None, "correction": None,
            "oracle_rmse": 1.0, "core": {}, **more}


class Diagnosed:
    """What a stub diagnoser returns."""

    model = None

    def __init__(self, causes, verdict, rmse=1.0):
        self.result = {"verdict": verdict, "extended": {"rmse": rmse},
                       "findings": [{"cause": cause, "parameters": {
                           name: {"value": value, "std": abs(value) / 100, "unit": "1"}
                           for name, value in parameters.items()}}
                           for cause, parameters in causes.items()]}

    def as_dict(self):
        return self.result


def test_sets_of_names():
    right = row("single", ["offset"], ["offset"])
    silent = row("single", ["offset"], verdict="unexplained")
    extra = row("single", ["offset"], ["offset", "dead_zone"])
    crashed = row("single", ["offset"], error="crashed: x", verdict=None)
    assert [score.exact(r) for r in (right, silent, extra, crashed)] == [True, False, False, False]
    assert [score.wrong(r) for r in (right, silent, extra)] == [set(), set(), {"dead_zone"}]
    assert score.confusion([right, silent, extra, crashed]) == {
        "offset": {"offset": 2, "nothing": 1, "dead_zone": 1, "error": 1}}
    assert score.consistent(row("clean", [], verdict="consistent"))
    assert not score.consistent(row("clean", [], ["offset"], verdict="consistent"))
    assert score.unexplained(row("outside", ["impact_stop"], verdict="partly_explained"))
    assert not score.unexplained(row("outside", ["impact_stop"], ["offset"], "partly_explained"))
    assert not score.unexplained(row("outside", ["impact_stop"], verdict="consistent"))


def test_intervals_of_shares_cover():
    rng = np.random.default_rng(0)
    for truth in (0.05, 0.5, 0.97):
        intervals = [score.share(rng.random(40) < truth) for _ in range(400)]
        assert np.mean([s.low <= truth <= s.high for s in intervals]) >= 0.94
    assert score.share([]).n == 0 and str(score.share([])) == "-"


def test_parameters_are_judged_by_value_departure_and_interval():
    def judged(cause, truth, found, std, **core):
        return row("single", [cause], truth={cause: truth}, core=core) | {"findings": {
            cause: {name: {"value": value, "std": std} for name, value in found.items()}}}

    errors = score.parameter_errors([
        judged("sensitivity_error", {"gain": 1.02}, {"gain": 1.03}, 0.004),
        judged("sensitivity_error", {"gain": 1.02}, {"gain": 1.021}, 0.004),
        judged("core_parameter_shift", {"damping_ratio": 0.22}, {"damping_ratio": 0.21}, 0.02,
               damping_ratio=0.2),
        judged("offset", {"offset": -1.0}, {"offset": -1.2}, None),
        row("single", ["dead_zone"], truth={"dead_zone": {"half_width": 1.0}})])
    gain = errors["sensitivity_error", "gain"]
    assert (gain.of_value.successes, gain.of_departure.successes, gain.covered.successes) \
        == (2, 1, 1)
    ratio = errors["core_parameter_shift", "damping_ratio"]
    assert (ratio.of_value.successes, ratio.of_departure.successes) == (1, 0)
    offset = errors["offset", "offset"]
    assert (offset.of_value.successes, offset.covered.n, offset.without_std) == (0, 0, 1)
    assert len(errors) == 3


def test_logistic_threshold_finds_where_the_curve_passes():
    rng = np.random.default_rng(1)
    strength = 10 ** rng.uniform(-1.5, 1, 24)
    for middle, slope in ((0.3, 8.0), (1.0, 5.0)):
        truth = 10 ** (np.log10(middle) + np.log(9) / slope)
        estimates = [score.logistic_threshold(
            strength, rng.random(24) < expit(slope * np.log10(strength / middle)))
            for _ in range(100)]
        assert 0.8 < np.exp(np.mean(np.log(estimates))) / truth < 1.25
    step = score.logistic_threshold(strength, strength > 1)
    assert strength[strength < 1].max() * 0.9 < step < 1.6 * strength[strength > 1].min()
    assert np.isnan(score.logistic_threshold(strength, np.zeros(24, bool)))
    assert score.logistic_threshold(strength, np.ones(24, bool)) < strength.min() * 1.1


def test_likelihood_ratio_limit_is_that_of_the_test_itself():
    """Two known shapes of unknown size in white noise: count how often the test finds them."""
    rng = np.random.default_rng(2)
    n, false_alarm = 500, 0.01
    limit = score.likelihood_ratio_limit(n, 2, false_alarm)
    shapes = np.linalg.qr(rng.normal(size=(n, 2)))[0]
    effect = shapes @ [0.6, 0.8] * np.sqrt(n) * limit
    noise = rng.normal(size=(4000, n)) @ shapes
    statistic = np.sum((noise + effect @ shapes) ** 2, axis=1)
    threshold = np.quantile(np.sum((rng.normal(size=(40_000, 2))) ** 2, axis=1), 1 - false_alarm)
    assert abs(np.mean(statistic > threshold) - 0.9) < 0.025


def test_power_of_a_cause_that_is_found_from_its_noise_on():
    strengths = np.geomspace(0.03, 10, 24)
    rows = [row("power", ["offset"], ["offset"] if s > 1 else [], strength={"offset": s},
                truth={"offset": {"offset": s}}) for s in strengths]
    power = score.power(rows, 0.01)
    assert 0.7 < power.found_in_90_percent < 2.2
    assert (power.smallest, power.largest, power.found.successes) == (strengths[0], 10.0, 10)
    assert power.limit == score.likelihood_ratio_limit(24_000, 1, 0.01)
    unfound = [r | {"findings": {}} for r in rows]
    assert np.isnan(score.power(unfound, 0.01).found_in_90_percent)
    unfound = [r | {"causes": ("dead_zone",), "truth": {"dead_zone": {"half_width": 1.0}},
                    "strength": {"dead_zone": r["strength"]["offset"]}} for r in unfound]
    page = markdown(rows + unfound, "this test")
    assert "| `dead_zone` | above 10 |" in page


def test_gains_against_the_oracle():
    rows = [row("single", ["offset"], ["offset"], extended_rmse=1.1, oracle_rmse=1.0,
                correction={"in_use": 5.0, "extended": 3.0, "oracle": 3.0}),
            row("single", ["offset"], ["offset"], extended_rmse=3.0, oracle_rmse=2.0,
                correction={"in_use": 5.0, "extended": 4.0, "oracle": 3.0}),
            row("single", ["offset"], ["offset"], correction="cannot be inverted"),
            row("single", ["offset"], correction=None)]
    assert score.error_over_oracle(rows) == pytest.approx([1.1, 1.5])
    shares, errors = score.correction_share(rows)
    assert shares == pytest.approx([1.0, 9 / 16]) and errors == {"cannot be inverted": 1}


def test_trials_are_unique_and_no_seed_is_in_two_sets():
    plans = [plan(seed_set) for seed_set in (0, 1)]
    assert len({(t.name, t.seed) for p in plans for t in p}) == sum(map(len, plans))
    assert {t.group for t in plans[0]} == set(GROUPS)
    counts = {group: sum(t.group == group for t in plans[0]) for group in GROUPS}
    assert counts == {"single": 440, "multiple": 60, "clean": 100, "outside": 190,
                      "without_model": 54, "power": 528, "second_set": 288,
                      "road_single": 222, "road_multiple": 40, "road_clean": 60,
                      "road_outside": 114}
    assert not {t.seed for t in plans[0]} & {t.seed for t in plans[1]}
    assert len(plan(0, ["single"], first=2)) == 44


def test_a_diagnoser_that_knows_the_truth_a_silent_and_a_broken_one():
    trials = [plan(7, [group], first=1)[0]
              for group in ("clean", "outside", "single", "road_outside")]
    roads = trials.pop()

    def knowing(trial):
        def diagnose(pair, model, axis, temperature):
            assert model is not None and axis == "x" and len(pair[0].stamps_ns) > 1000
            case = draw_case(trial.seed, trial.causes)
            if trial.group == "outside":
                return Diagnosed({}, "unexplained")
            return Diagnosed(case.truth, "explained" if trial.causes else "consistent",
                             case.noise_std)
        return diagnose

    def silent(pair, model, axis, temperature):
        return Diagnosed({}, "consistent")

    def broken(pair, model, axis, temperature):
        raise FracAccelError("nothing") if len(pair[0].stamps_ns) % 2 else ZeroDivisionError("x")

    rows = []
    for trial in trials:
        if trial.group == "single":  # its model is not at hand here: no correction is judged
            trial = trial._replace(group="power")
        rows.append(run(trial, knowing(trial)))
    clean, outside, single = rows
    assert score.consistent(clean) and score.unexplained(outside)
    assert score.exact(single) and not score.wrong(single)
    errors = score.parameter_errors([single])
    assert score.right(clean) and score.right(outside) and score.right(single) is None
    assert errors and all(e.of_value.low == e.covered.low > 0 for e in errors.values())
    silence = run(trials[2], silent)
    assert not score.exact(silence) and not score.wrong(silence)
    failed = run(trials[0], broken)
    assert failed["error"].startswith(("refused: nothing", "crashed: ZeroDivisionError"))
    far = run(roads._replace(times_noise=1.0), silent)
    assert far["causes"] == ("gain_modulation",) and not score.unexplained(far)
    page = markdown([*rows, silence, failed, far], "this test")
    assert "## Verdicts" in page and "`gain_modulation`" in page and "road, outside" in page


def test_undecided_names_nothing():
    judged = {group: score.right(row(group, causes, verdict="undecided"))
              for group, causes in {"clean": (), "outside": ("moving_delay",),
                                    "road_clean": (), "road_outside": ("lever_arm",),
                                    "single": ("offset",), "second_set": ("backlash",),
                                    "road_single": ("offset",), "road_multiple": ("offset",),
                                    }.items()}
    assert judged == {"clean": True, "outside": True, "road_clean": True, "road_outside": True,
                      "single": False, "second_set": False, "road_single": False,
                      "road_multiple": False}
    named = row("road_outside", ["lever_arm"], ["offset"], verdict="undecided")
    assert not score.right(named)
    assert not score.right(row("clean", [], ["offset"], verdict="undecided"))
    assert not score.right(row("outside", ["lever_arm"], verdict="consistent"))


def test_what_the_surroundings_have_may_be_named_or_not():
    around = {"besides": {"reference_noise": {"std": 0.1}}}
    both, one, other = (row("road_single", ["offset"], names, **around) for names in
                        (["offset", "reference_noise"], ["offset"], ["reference_noise"]))
    assert [score.right(r) for r in (both, one, other)] == [True, True, False]
    assert [score.wrong(r) for r in (both, one, other)] == [set(), set(), set()]
    clean = row("road_clean", [], ["reference_noise"], verdict="explained", **around)
    assert score.right(clean) and not score.right(clean | {"besides": {}})


def test_words_among_the_parameters_and_intervals_in_all():
    truth = {"corner_hz": 44.0, "order": 2, "family": "bessel"}
    found = {"corner_hz": {"value": 45.0, "std": 1.0}, "order": {"value": 2, "std": 0.0}}
    one = row("second_set", ["low_pass_filter"], truth={"low_pass_filter": truth})
    one["findings"] = {"low_pass_filter": found}
    far = one | {"findings": {"low_pass_filter": found | {
        "corner_hz": {"value": 60.0, "std": 1.0}}}}
    assert set(score.parameter_errors([one])) == {("low_pass_filter", "corner_hz"),
                                                  ("low_pass_filter", "order")}
    assert sorted(score.coverage([one, far])) == [False, True, True, True]
