"""The command line itself: its list, help and hints, completion, progress, and how it starts."""

import fcntl
import os
import pty
import re
import shlex
import shutil
import struct
import subprocess
import sys
import termios
from pathlib import Path

import pytest

from frac_accel import FracAccelError, SensorModel, diagnose, identify
from frac_accel.cli import VERBS, _parser, main

ROOT = Path(__file__).parents[2]
BAGS = ROOT / "bags"


def said(capsys, *arguments):
    """Exit status, standard output and error of a command."""
    try:
        status = main(list(arguments))
    except SystemExit as stop:
        status = stop.code
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def in_terminal(code):
    """What a Python program writes to a terminal."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("4H", 24, 100, 0, 0))
    with subprocess.Popen([sys.executable, "-c", code], stdin=theirs, stdout=theirs, stderr=theirs,
                          cwd=ROOT):
        os.close(theirs)
        text = b""
        try:
            while part := os.read(ours, 4096):
                text += part
        except OSError:  # how Linux says that nobody is left on the other side
            pass
    os.close(ours)
    return text.decode(errors="replace")


def test_alone_it_lists_the_commands(capsys):
    status, out, err = said(capsys)
    assert status == 0 and not err
    lines = out.splitlines()
    assert [line.split()[1] for line in lines[:-1]] == list(VERBS)
    assert all(len(line) < 100 for line in lines)


def test_version(capsys):
    status, out, _ = said(capsys, "--version")
    assert status == 0
    assert re.fullmatch(r"frac_accel (\d+\.\d+\.\d+\S*|not installed)\n", out)


@pytest.mark.parametrize("arguments, words", [
    (["identfy", "x"], "no command 'identfy': did you mean 'identify'?"),
    (["zzz"], "no command 'zzz'; frac_accel lists them"),
    (["correct", "b.mcap", "--modle", "m.yaml", "-o", "c.mcap"],
     "unknown option --modle: did you mean '--model'?"),
    (["correct", "b.mcap", "--model", "m.yaml", "-o", "c.mcap", "--bandwith=3"],
     "unknown option --bandwith: did you mean '--bandwidth'?"),
    (["correct", "b.mcap", "more.mcap", "--model", "m.yaml", "-o", "c.mcap"],
     "unknown argument more.mcap"),
    (["correct", "b.mcap", "--model", "m.yaml", "-o", "c.mcap", "--bandwidth", "wide"],
     "'wide' given, expected a number above 0"),
    (["validate", "b.mcap"], "required: --model"),
    (["fleet", "diagnos", "drives"], "'diagnos' given, expected one of diagnose, correct, "
     "identify, validate: did you mean 'diagnose'?"),
    (["correct", "--version"], "unknown option --version; see"),
])
def test_a_mistake_is_one_line_with_the_nearest_name(arguments, words, capsys):
    status, out, err = said(capsys, *arguments)
    assert status == 2 and not out
    line, = err.splitlines()
    assert words in line and line.startswith("frac_accel")


@pytest.mark.parametrize("verb", VERBS)
def test_each_help_has_examples_that_can_be_given(verb, capsys):
    status, out, _ = said(capsys, verb, "--help")
    assert status == 0
    examples = [line.strip() for line in out.partition("examples:\n")[2].splitlines()]
    assert examples
    for example in examples:
        name, *arguments = shlex.split(re.sub(r"\s(>|#).*", "", example))
        assert name == "frac_accel" and arguments[0] == verb
        parser, _, _ = _parser(verb, arguments)
        assert parser.parse_args(arguments).verb == verb


@pytest.mark.parametrize("verb", ["diagnose", "correct", "identify", "validate"])
def test_each_help_within_fleet_has_its_own_example(verb, capsys):
    status, out, _ = said(capsys, "fleet", verb, "--help")
    examples = [line.strip() for line in out.partition("examples:\n")[2].splitlines()]
    assert status == 0 and examples
    for example in examples:
        arguments = shlex.split(example)[1:]
        assert arguments[:2] == ["fleet", verb]
        parser, _, _ = _parser("fleet", arguments)
        assert parser.parse_args(arguments).each == verb


@pytest.mark.parametrize("verb", ["", *VERBS])
def test_help_loads_no_numerical_library(verb):
    """Which would cost more than all else that it does."""
    heavy = {"numpy", "scipy", "yaml", "tqdm", "plotly", "pyarrow",
             *({"difflib", "importlib.metadata"} if not verb else ())}
    code = ("import sys; from frac_accel.cli import main\n"
            f"try: main([*{[verb] if verb else []}, '--help'])\n"
            f"except SystemExit: print({heavy} & {{*sys.modules}})")
    result = subprocess.run([sys.executable, "-S", "-c", code], capture_output=True, text=True,
                            cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert result.stdout.splitlines()[-1] == "set()", result.stderr


def test_the_structures_on_offer_are_those_of_the_identification():
    from frac_accel.commands._common import STRUCTURES
    from frac_accel.identification import STRUCTURES as there
    assert STRUCTURES == there


@pytest.fixture(scope="module")
def completions(tmp_path_factory):
    """Name of the script for a shell."""
    pytest.importorskip("shtab")

    def make(shell):
        path = tmp_path_factory.mktemp("completion") / shell
        result = subprocess.run([sys.executable, "-m", "frac_accel.cli", "completion", shell],
                                capture_output=True, text=True, cwd=ROOT)
        assert result.returncode == 0, result.stderr
        path.write_text(result.stdout)
        return path
    return make


COMPLETED = [("dia", "diagnose"), ("correct --ba", "--bandwidth"),
             ("identify --structure fracti", "fractional"), ("correct READ", "README.md")]


def test_bash_completes(completions):
    script = f"source {completions('bash')}\n"
    for line, _ in COMPLETED:
        words = " ".join(["frac_accel", *line.split()])
        script += (f"COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); COMPREPLY=()\n"
                   "function=$(complete -p frac_accel | sed 's/.*-F \\([^ ]*\\).*/\\1/')\n"
                   "$function frac_accel; echo ${COMPREPLY[@]}\n")
    result = subprocess.run(["bash", "-c", script], capture_output=True, text=True, cwd=ROOT)
    for (_, wanted), line in zip(COMPLETED, result.stdout.splitlines(), strict=True):
        assert wanted in line.split()


def test_fish_completes(completions):
    if not shutil.which("fish"):
        pytest.skip("no fish on this machine")
    script = f"source {completions('fish')}\n" + "\n".join(
        f"complete -C 'frac_accel {line}' | cut -f 1 | tr '\\n' ' '; echo" for line, _ in COMPLETED)
    result = subprocess.run(["fish", "-c", script], capture_output=True, text=True, cwd=ROOT)
    for (_, wanted), line in zip(COMPLETED[:3], result.stdout.splitlines()):
        assert wanted in line.split()


def test_zsh_takes_its_script(completions):
    script = completions("zsh")
    assert script.read_text().startswith("#compdef frac_accel")
    if not shutil.which("zsh"):
        pytest.skip("no zsh on this machine")
    code = f"autoload -U compinit && compinit -u; source {script} && which _shtab_frac_accel"
    result = subprocess.run(["zsh", "-fc", code], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


PROGRESS = ("import time; from frac_accel.commands._common import share_done\n"
            "with share_done() as show:\n"
            "    for i in range(6): show('fitting', i / 6); time.sleep(0.45)\n")


def test_progress_is_for_terminals_with_the_share_done_and_the_time_left():
    shown = in_terminal(PROGRESS)
    assert re.search(r"fitting: (67|83) % done.*about 00:0\d left", shown), shown
    piped = subprocess.run([sys.executable, "-c", PROGRESS], capture_output=True, text=True,
                           cwd=ROOT)
    assert (piped.stdout, piped.stderr, piped.returncode) == ("", "", 0)


@pytest.mark.parametrize("steps, words", [
    # without a step for long
    ("show('fitting', 0); time.sleep(3.2)", r"fitting: 0 % done.*00:03"),
    # small ones after a large one
    ("show('fitting', 0); time.sleep(2.2); show('fitting', 0.5); time.sleep(0.3)\n"
     "    for i in range(5): show('judging', 0.5 + 0.01 * i); time.sleep(0.3)",
     r"judging: 53 % done"),
])
def test_progress_does_not_stand_still(steps, words):
    code = f"{PROGRESS.splitlines()[0]}\nwith share_done() as show:\n    {steps}\n"
    shown = in_terminal(code + "print('the end')")
    assert re.search(words, shown), shown
    # nothing of it is left
    assert re.search(r"\r +\rthe end", shown), repr(shown)


@pytest.mark.parametrize("run", [
    lambda show: identify(BAGS / "fractional_bench.mcap", progress=show),
    lambda show: identify([BAGS / "classical_bench.mcap", BAGS / "fractional_bench.mcap"],
                          structure="fractional", progress=show),
    lambda show: diagnose(BAGS / "soft_mount.mcap", SensorModel.load(BAGS / "soft_mount.yaml"),
                          progress=show)])
def test_steps_tell_the_share_that_is_done_and_no_raw_figures(run):
    steps = []
    run(lambda words, share: steps.append((words, share)))
    shares = [share for _, share in steps]
    assert shares == sorted(shares) and 0 <= shares[0] < 0.1 and 0.6 < shares[-1] <= 1
    assert not [words for words, _ in steps if re.search(r"\d\.\d|e[+-]\d", words)]


@pytest.mark.parametrize("bad, words", [("one_sine.mcap", "excites only 300 Hz")])
def test_an_error_in_one_of_several_bags_names_the_bag(bad, words, capsys, tmp_path):
    status, _, err = said(capsys, "identify", str(BAGS / "classical_bench.mcap"), str(BAGS / bad),
                          "-o", str(tmp_path / "m.yaml"))
    assert status == 2
    assert bad in err and words in err and "classical_bench" not in err


def test_a_record_that_is_given_twice_is_refused(capsys, tmp_path):
    """It would count twice, and its parameters would look surer than they are."""
    copy = shutil.copy(BAGS / "classical_bench.mcap", tmp_path / "copy.mcap")
    status, _, err = said(capsys, "identify", str(BAGS / "classical_bench.mcap"), str(copy),
                          "-o", str(tmp_path / "m.yaml"))
    assert status == 2 and f"{copy}: holds the same record as" in err


def test_an_error_in_one_of_several_arrays_names_the_record():
    good = BAGS / "classical_bench.mcap"
    with pytest.raises(FracAccelError, match="^second: "):
        identify([good, BAGS / "one_sine.mcap"], records=["first", "second"])
