"""Causes that were missed in cars: rates that differ, a noisy reference, gravity on the axis."""

import pytest
from rig.hidden import draw_case
from rig.road_cases import draw_road_case

from frac_accel import diagnose


def names(case):
    reference, sensor, temperature = case.samples()
    found = diagnose((reference, sensor), case.model(), temperature=temperature)
    return {finding.cause for finding in found.findings}, found


def assert_named(case):
    found, _ = names(case)
    assert case.causes <= found <= case.causes | set(case.besides)


def reasons(result):
    """Why each suspect has no name."""
    return {cause: each["reason"] for each in result.suspects for cause in each["causes"]}


@pytest.mark.parametrize("seed, cause", [
    (7_160_000, "quantization"),         # of values that were put on other instants
    (7_160_000, "interference_bursts"),
    (7_160_000, "late_stamps"),          # beside a reference whose noise fills the band
    (7_460_000, "offset"),               # under gravity a dead zone does the same
    (7_660_000, "clipping"),             # of so few values that they need a model to be certain
    (7_660_000, "timestamp_jitter"),     # of stamps whose values were put on other instants
    (9_160_000, "ac_coupling"),          # beside a lead of a thousandth of an interval
    (9_160_000, "mounting_resonance"),   # a motion guessed from a noisy reference leaves bursts
    (9_460_000, "time_delay"),           # beside a clock that does less than the noise
    (9_260_000, "sampling_jitter"),      # on a lattice that makes values repeat, as a poll does
    # an engine's tone by a notch of the average
    pytest.param(9_260_000, "reference_smoothing", marks=pytest.mark.thorough),
])
def test_named_on_the_road(seed, cause):
    case = draw_road_case(seed, [cause])
    assert_named(case)


@pytest.mark.thorough
def test_noise_of_the_reference_shows_beside_a_louder_sensor():
    """The reference's low-pass is turned back, its noise with it: a filter would take that."""
    case = draw_road_case(9_160_000, ["reference_low_pass"])
    found, result = names(case)
    assert case.causes <= found <= case.causes | set(case.besides) | {"reference_noise"}
    (std,) = (x.effect.std for x in result.findings if x.cause == "reference_noise")
    assert std == pytest.approx(case.sensor.effects["reference_noise"]["std"], rel=0.05)


@pytest.mark.thorough
def test_what_comes_across_stands_beside_coarse_rounding():
    case = draw_case(9_120_019, ["ac_coupling", "cross_axis_sensitivity", "quantization"])
    found, _ = names(case)
    assert found == case.causes


def test_what_scattered_stamps_leave_open_is_no_other_cause():
    """A skew that the stamps do not rule out had no name, and a stiffness that drifts took its
    place."""
    case = draw_road_case(9_160_001, ["timestamp_jitter"])
    assert_named(case)


def test_noise_of_the_reference_that_shows_nowhere_is_no_filter_without_a_delay():
    case = draw_road_case(9_160_000, ["low_pass_lag"])
    found, _ = names(case)
    assert not found - case.causes - set(case.besides)


def test_a_zero_that_follows_the_vibration_is_no_burst_of_noise():
    case = draw_road_case(7_690_000, ["rectification_memory"])
    found, _ = names(case)
    assert not found - set(case.besides)


@pytest.mark.thorough
@pytest.mark.parametrize("seed, cause", [
    (903, "sensitivity_error"), (903, "low_pass_lag"), (900, "cubic_stiffness"),
    (902, "cubic_stiffness")])
def test_named_beside_instants_that_scatter(seed, cause):
    found, result = names(draw_case(seed, [cause, "sampling_jitter"]))
    assert found == {cause, "sampling_jitter"}
    assert result.verdict == "explained"


def test_a_poll_shows_within_what_a_slower_reference_shows():
    """What it adds was folded down where it was put on the record's instants."""
    case = draw_road_case(9_270_014, ["dropped_samples", "polled_readout"])
    assert_named(case)


@pytest.mark.thorough
def test_noise_of_the_reference_that_the_sensor_drowns_is_no_low_pass():
    """Beside a clock that runs off filters were tried until the time was over."""
    case = draw_road_case(9_360_000, ["clock_skew"])
    assert_named(case)


@pytest.mark.thorough
def test_a_poll_on_a_lattice_is_no_scatter_of_the_instants():
    found, _ = names(draw_road_case(9_360_000, ["polled_readout"]))
    assert "polled_readout" in found and "sampling_jitter" not in found


@pytest.mark.thorough
def test_instants_that_scatter_show_beside_clipping_on_two_grids():
    """What stands in for clipped samples is off where the motion is fast, and the filter to the
    band lets it through on either side."""
    case = draw_road_case(9_170_017, ["clipping", "sampling_jitter", "thermal_offset"])
    assert_named(case)


@pytest.mark.thorough
def test_a_tone_of_a_gain_that_comes_and_goes_has_no_name():
    case = draw_road_case(9_290_000, ["gain_modulation"])
    found, result = names(case)
    assert not found - set(case.besides)
    assert "goes with the motion times it" in reasons(result)["tone_interference"]


@pytest.mark.thorough
def test_a_gain_that_differs_by_the_side_is_no_one_gain():
    case = draw_road_case(9_390_000, ["asymmetric_gain"])
    found, result = names(case)
    assert not found - set(case.besides)
    assert "to one side" in reasons(result)["sensitivity_error"]


def test_two_laws_in_time_are_no_course():
    """A course of the zero described both, and the search beside it took all of its time."""
    assert_named(draw_road_case(9_370_000, ["gain_drift", "thermal_offset"]))


def test_shocks_between_samples_that_are_shifted_are_no_bursts():
    """What two instruments record of a shock of a moment depends on when they look."""
    assert_named(draw_road_case(
        9_370_017, ["offset_drift", "reference_delay", "timestamp_jitter"]))
