"""A seeded sample of the blind suite (`make blind`)."""

import pytest
from blind import score
from blind.plan import plan
from blind.trial import run

pytest.importorskip("frac_accel.diagnosis")

SEED_SET = 900  # not one that the suite's page is made with
SHARES = 4      # of the single causes, so that two workers are equally busy


def sample(group, first, every=1):
    """Rows of a group; refusals and crashes fail the test here, with their words."""
    rows = [run(trial) for trial in plan(SEED_SET, [group], first)[::every]]
    assert not [(row["name"], row["error"]) for row in rows if row["error"]]
    return rows


def misses(rows, right):
    """What a failing test shows of the rows that are not as they should be."""
    return [(row["name"], row["seed"], row["verdict"], sorted(row["findings"]))
            for row in rows if not right(row)]


@pytest.mark.parametrize("part", range(SHARES))
def test_one_hidden_cause_is_named(part):
    rows = [run(trial) for trial in plan(SEED_SET, ["single"], 1)[part::SHARES]]
    wrong = misses(rows, score.exact)
    assert len(wrong) <= 1, wrong


def test_a_sensor_as_modelled_is_consistent():
    rows = sample("clean", 5)
    assert not misses(rows, score.consistent)


def test_several_hidden_causes_are_named():
    rows = sample("multiple", 6)
    wrong = misses(rows, score.exact)
    assert len(wrong) <= 1, wrong


def test_physics_outside_the_catalogue_gets_no_name():
    rows = sample("outside", 1)
    assert not misses(rows, score.unexplained)


def test_an_identified_model_leads_to_no_wrong_name():
    rows = sample("without_model", 1, every=4)
    assert not misses(rows, lambda row: not score.wrong(row))
