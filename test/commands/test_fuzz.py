"""A fixed share of the damaged inputs of `fuzz`: each refused in one line, or worked on."""

import pytest
from fuzz import case, live, runner

from frac_accel.cli import VERBS

# About 6 s of one core for each group.
GROUPS, CASES = 4, 50


@pytest.mark.parametrize("group", range(GROUPS))
def test_damaged_inputs_are_refused_or_worked_on(group):
    assert runner.run(range(group * CASES, (group + 1) * CASES)) == {}


def test_any_model_file_is_taken_or_refused_while_the_corrector_works():
    seen = []
    assert runner.run(range(60), None, lambda *told: seen.append(told[2]), live.judge) == {}
    assert {"accepted", "refused"} <= {*seen}


# Numbers of cases that once went wrong.
ONCE_WRONG = [45, 63, 89, 99, 1036, 1091, 1109, 1141, 1347, 1394, 10105, 11442, 11472, 11552,
              11658, 38689, 40061, 42072, 44303]


def test_what_once_went_wrong_does_not_again():
    assert runner.run(ONCE_WRONG) == {}


def test_every_command_has_its_turn_or_a_reason():
    assert sorted([*case.SHARES, *case.BY_NUMBER, *case.WITHOUT]) == sorted(VERBS)


def test_a_case_is_the_same_again(tmp_path):
    for number in range(20):
        made = []
        for folder in (tmp_path / f"a{number}", tmp_path / f"b{number}"):
            folder.mkdir()
            arguments, _, what = case.make(number, folder)
            made.append((what, [part.replace(str(folder), "") for part in arguments], {
                str(path.relative_to(folder)): path.read_bytes()
                for path in folder.rglob("*") if path.is_file()}))
        assert made[0] == made[1]


WRONG = {
    "status": ("raise IndexError", "status 3"),
    "memory": ("bytearray(2**31)", "more than 1024 MiB"),
    "leftover": ("open(arguments.model + '.x', 'w').close()", "made"),
    "input": ("open(arguments.model, 'a').write('#')", "inputs changed"),
    "crash": ("os.kill(os.getpid(), 11)", "ended by SIGSEGV"),
    "lines": ("print('more', file=sys.stderr); raise FracAccelError('x' * 30)", "in 2 lines"),
}


@pytest.mark.parametrize("name", WRONG)
def test_the_runner_sees_what_is_wrong(name, monkeypatch, tmp_path):
    """Each of its checks fails where it should."""
    from frac_accel.commands import correct
    code, words = WRONG[name]
    space = {}
    exec("import os, sys\nfrom frac_accel.errors import FracAccelError\n"
         f"def run(arguments):\n    {code}\n", space)
    monkeypatch.setattr(correct, "run", space["run"])
    monkeypatch.setattr(case, "SHARES", {"correct": 1.0})
    found = runner.run([3], tmp_path)
    assert words in " ".join(found[3])
    assert (tmp_path / "3" / "m.yaml").exists()


def test_the_runner_sees_that_time_is_up(monkeypatch):
    from frac_accel.commands import correct

    def forever(arguments):
        while True:
            pass
    monkeypatch.setattr(correct, "run", forever)
    monkeypatch.setattr(case, "SHARES", {"correct": 1.0})
    monkeypatch.setattr(runner, "MOST_SECONDS", 0)
    assert "more than 0 s" in " ".join(runner.run([3])[3])
