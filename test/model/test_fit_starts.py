"""Every cause that is fitted says where its fit begins."""

import pytest
from rig.hidden import draw_case
from searched import searched

from frac_accel.model.effects import known_effects


@pytest.fixture(scope="module")
def view():
    case = draw_case(7, ["temperature_sensitivity"])
    _, engine, _ = searched(case)
    return engine.search.view(engine.search.fit(engine.search.base))


# What that record does not show: the mass reaches no stop, and one axis moves. They are found again
# in test_further_forces and test_misalignment.
NOT_SHOWN = ("impact_stop", "misalignment")


@pytest.mark.parametrize(
    "cause", [cause for cause, effect in known_effects().items() if not effect.read_off])
def test_a_fit_of_every_cause_begins_somewhere(view, cause):
    starts = known_effects()[cause].starts(view)
    assert starts or cause in NOT_SHOWN
    assert all(start.effect.cause == cause for start in starts)
