"""Outputs of a command: never an input nor each other, and all or none, whatever happens."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from frac_accel import cli
from frac_accel.cli import VERBS, main
from frac_accel.commands import _common
from frac_accel.errors import FracAccelError
from frac_accel.io import outputs
from frac_accel.io.bag import read_bag, write_bag

BAGS = Path(__file__).parents[2] / "bags"
BAG, MODEL = BAGS / "classical_bench.mcap", BAGS / "classical_bench.yaml"
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with a bag, its model, and other names of both."""
    folder = tmp_path / "place"
    folder.mkdir()
    (folder / "deeper").mkdir()
    shutil.copy(BAG, folder / "in.mcap")
    shutil.copy(MODEL, folder / "m.yaml")
    for name in ("in.mcap", "m.yaml"):
        os.link(folder / name, folder / f"hard_{name}")
        os.symlink(name, folder / f"soft_{name}")
    write_bag(folder / "bag", read_bag(BAG))
    monkeypatch.chdir(folder)
    return folder


def content(folder):
    return {str(path.relative_to(folder)): path.read_bytes()
            for path in sorted(folder.rglob("*")) if path.is_file()}


CORRECT = ["correct", "in.mcap", "--model", "m.yaml", "-o"]
IDENTIFY = ["identify", "in.mcap", "-o"]
SAME = {
    "correct: json is the bag": [*CORRECT, "o.mcap", "--json", "in.mcap"],
    "correct: json is the model": [*CORRECT, "o.mcap", "--json", "m.yaml"],
    "correct: json is the output": [*CORRECT, "o.mcap", "--json", "o.mcap"],
    "correct: json is the output by another spelling":
        [*CORRECT, "o.mcap", "--json", "deeper/../o.mcap"],
    "correct: output is the bag": [*CORRECT, "in.mcap"],
    "correct: output is the bag by a hard link": [*CORRECT, "hard_in.mcap"],
    "correct: output is the bag by a symbolic link": [*CORRECT, "soft_in.mcap"],
    "correct: output is the bag by another spelling": [*CORRECT, "deeper/../in.mcap"],
    "correct: output is the model": [*CORRECT, "hard_m.yaml"],
    "correct: output is in the bag's folder":
        ["correct", "bag", "--model", "m.yaml", "-o", "bag/bag_1.mcap"],
    "correct: json is a bag's metadata":
        ["correct", "bag", "--model", "m.yaml", "-o", "o.mcap", "--json", "bag/metadata.yaml"],
    "correct: json is a file of a bag":
        ["correct", "bag", "--model", "m.yaml", "-o", "o.mcap", "--json", "bag/bag_0.mcap"],
    "simulate: output is the bag": ["simulate", "in.mcap", "--model", "m.yaml", "-o",
                                    "hard_in.mcap"],
    "simulate: json is the model": ["simulate", "in.mcap", "--model", "m.yaml", "-o", "o.mcap",
                                    "--json", "soft_m.yaml"],
    "validate: json is the model": ["validate", "in.mcap", "--model", "m.yaml", "--json", "m.yaml"],
    "validate: json is the bag": ["validate", "in.mcap", "--model", "m.yaml", "--json", "in.mcap"],
    "identify: output is the bag": [*IDENTIFY, "hard_in.mcap"],
    "identify: json is the output": [*IDENTIFY, "o.yaml", "--json", "./o.yaml"],
    "identify: report is the output": [*IDENTIFY, "o.yaml", "--report", "o.yaml"],
    "identify: report is the bag": [*IDENTIFY, "o.yaml", "--report", "soft_in.mcap"],
    "identify: json is a further bag": ["identify", "in.mcap", "bag", "-o", "o.yaml", "--json",
                                        "bag/bag_0.mcap"],
    "diagnose: extended model is the model": ["diagnose", "in.mcap", "--model", "m.yaml",
                                              "--extended-model", "hard_m.yaml"],
    "diagnose: json is the report": ["diagnose", "in.mcap", "--report", "r", "--json", "r"],
    "diagnose: json is the bag": ["diagnose", "in.mcap", "--json", "in.mcap"],
    "paper: json is the report": ["paper", "--quick", "--report", "r", "--json", "r"],
    "paper: json is one of the bags": ["paper", "--bags", "bag", "--json", "bag/bag_0.mcap"],
}


@pytest.mark.parametrize("case", SAME)
def test_an_output_is_never_an_input_nor_another_output(case, place, capsys):
    before = content(place)
    assert main(SAME[case]) == 2
    line, = capsys.readouterr().err.strip().splitlines()
    assert any(words in line for words in ("is the input", "two outputs", "part of the input"))
    assert content(place) == before


def test_the_papers_own_bags_are_inputs(place, monkeypatch, capsys):
    monkeypatch.setattr("frac_accel.commands.paper.BAGS", place)
    assert main(["paper", "--quick", "--json", "in.mcap"]) == 2
    assert "is the input" in capsys.readouterr().err


def test_every_option_that_names_a_file_is_known_as_input_or_output():
    import argparse
    import importlib
    named = set()
    for verb in VERBS:
        parser = argparse.ArgumentParser()
        importlib.import_module(f"frac_accel.commands.{verb}").add_arguments(parser)
        for action in parser._actions:
            if any(word in str(action.metavar) for word in (".", "FILE", "BAG", "FOLDER")):
                named.add(action.dest)
    assert named == {*_common.INPUTS, *_common.OUTPUTS}


def test_a_folder_of_results_may_be_an_input_folder(place):
    (place / "bag" / "result.json").write_text("old")
    arguments = ["correct", "bag", "--model", "m.yaml", "-o", "o.mcap", "--json",
                 "bag/result.json"]
    assert main(arguments) == 0
    assert json.loads((place / "bag" / "result.json").read_text())["counters"]["given"]


def test_devices_are_written_to_and_never_replaced(place, capfd):
    assert main([*CORRECT, "o.mcap", "--json", "/dev/null"]) == 0
    assert Path("/dev/null").is_char_device()
    capfd.readouterr()
    assert main(["validate", "in.mcap", "--model", "m.yaml", "--json", "/dev/stdout"]) == 0
    assert Path("/dev/stdout").is_symlink()
    assert '"corrected": {' in capfd.readouterr().out


def test_a_pipe_gets_the_result(place):
    os.mkfifo("pipe")
    got = []
    reader = threading.Thread(target=lambda: got.append(Path("pipe").read_text()), daemon=True)
    reader.start()
    assert main(["validate", "in.mcap", "--model", "m.yaml", "--json", "pipe"]) == 0
    reader.join(10)
    assert json.loads(got[0])["corrected"]
    assert Path("pipe").is_fifo()


@pytest.mark.parametrize("existing", [False, True])
def test_together_is_all_or_none(tmp_path, monkeypatch, existing):
    names = ("a.json", "b.html", "c")
    if existing:
        for name in names:
            (tmp_path / name).write_text(f"old {name}")
    before = content(tmp_path)

    def write_all():
        with outputs.together():
            for name in names:
                outputs.write_text(tmp_path / name, f"new {name}")
                assert content(tmp_path).items() >= before.items()

    rename, sync = os.replace, os.fsync

    def fails_for(function, count):
        """The function, which fails the count-th time and only then."""
        calls = []

        def failing(*arguments, **options):
            calls.append(arguments)
            if len(calls) == count:
                raise OSError(28, "No space left on device", *map(str, arguments[:1]))
            return function(*arguments, **options)
        return failing

    for name, function in (("replace", rename), ("fsync", sync)):
        for count in range(1, 20):
            monkeypatch.setattr(os, name, fails_for(function, count))
            try:
                write_all()
                break
            except (OSError, FracAccelError):
                assert content(tmp_path) == before
                assert len(list(tmp_path.iterdir())) == len(before)
        monkeypatch.setattr(os, name, function)
        assert count > 3
        assert content(tmp_path) == {name: f"new {name}".encode() for name in names}
        for path in tmp_path.iterdir():
            path.unlink()
        for name, data in before.items():
            (tmp_path / name).write_bytes(data)


# What changes anything on the disk, by module.
STEPS = [(os, name) for name in ("fsync", "replace", "link", "mkdir", "unlink", "rmdir")]


def killed_at(step, work):
    """Whether a process was killed before this one of its calls that change the disk."""
    child = os.fork()
    if child:
        return os.waitpid(child, 0)[1] == signal.SIGKILL
    count = 0

    def counted(function):
        def call(*arguments, **options):
            nonlocal count
            count += 1
            if count == step:
                os.kill(os.getpid(), signal.SIGKILL)
            return function(*arguments, **options)
        return call
    try:
        for module, name in STEPS:
            setattr(module, name, counted(getattr(module, name)))
        work()
    finally:
        os._exit(0)


@pytest.mark.parametrize("found_by", ["here", "there"])
@pytest.mark.parametrize("existing", [False, True])
def test_a_kill_between_the_renames_is_finished_by_the_next_run(tmp_path, existing, found_by):
    names = ["here/a.json", "there/b.html", "here/c"]
    for folder in ("here", "there"):
        (tmp_path / folder).mkdir()

    def begin():
        for name in names:
            (tmp_path / name).unlink(missing_ok=True)
            if existing:
                (tmp_path / name).write_text(f"old {name}")
        return content(tmp_path)

    def write_all():
        with outputs.together():
            for name in names:
                outputs.write_text(tmp_path / name, f"new {name}")

    new = {name: f"new {name}".encode() for name in names}
    before, step, seen = begin(), 1, []
    while killed_at(step, write_all):
        half = {name: (tmp_path / name).read_bytes() for name in names
                if (tmp_path / name).exists()}
        outputs.sweep(tmp_path / found_by)
        now = {name: data for name, data in content(tmp_path).items() if name in names}
        assert now in (before, new)
        seen.append((half in (before, new), now == new))
        for folder in ("here", "there"):
            outputs.sweep(tmp_path / folder)
        assert content(tmp_path) == now
        assert begin() == before
        step += 1
    assert content(tmp_path) == new
    # some were killed before, some between and some after the renames
    assert {(True, False), (False, True), (True, True)} == {*seen}


def test_what_somebody_has_changed_since_is_not_finished(tmp_path):
    def write_all():
        with outputs.together():
            for name in "ab":
                outputs.write_text(tmp_path / name, f"new {name}")
    step = 1
    while killed_at(step, write_all) and not (tmp_path / "a").exists():
        shutil.rmtree(tmp_path)
        tmp_path.mkdir()
        step += 1
    (tmp_path / "b").write_text("somebody's")
    outputs.sweep(tmp_path)
    assert content(tmp_path) == {"a": b"new a", "b": b"somebody's"}


@pytest.mark.parametrize("mode, followed", [(0o777, []), (0o770, []), (0o700, ["victim"])])
def test_a_list_that_others_may_have_written_is_not_followed(tmp_path, mode, followed):
    folder = tmp_path / ".frac_accel-x.partial"
    folder.mkdir(mode=0o700)
    (folder / "victim").write_text("evil")
    found = os.stat(folder / "victim")
    (folder / ".frac_accel-list").write_text(json.dumps(
        [[str(folder / "victim"), [found.st_dev, found.st_ino], None]]))
    folder.chmod(mode)
    outputs.sweep(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == followed


def test_without_hard_links_what_was_replaced_still_comes_back(tmp_path, monkeypatch):
    def link(*arguments, **options):
        raise OSError(1, "Operation not permitted")

    (tmp_path / "a").write_text("old")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "c").touch()
    monkeypatch.setattr(os, "link", link)
    with pytest.raises(FracAccelError, match="cannot be written"):
        with outputs.together():
            outputs.write_text(tmp_path / "a", "new")
            outputs.write_text(tmp_path / "b", "new")
            # a file cannot replace a folder, which comes out at the last moment only
    assert (tmp_path / "a").read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]


def test_the_folder_is_synced_after_the_rename(tmp_path, monkeypatch):
    done = []
    rename, sync = os.replace, os.fsync

    def note_sync(descriptor):
        done.append(os.readlink(f"/proc/self/fd/{descriptor}"))
        sync(descriptor)

    def note_rename(source, target):
        done.append(("rename", str(target)))
        rename(source, target)

    monkeypatch.setattr(os, "fsync", note_sync)
    monkeypatch.setattr(os, "replace", note_rename)
    outputs.write_text(tmp_path / "a", "text")
    assert done[-2:] == [("rename", str(tmp_path / "a")), str(tmp_path)]
    assert done[0].endswith("/a") and len(done) == 3


def test_a_failed_command_leaves_no_output_at_all(place, monkeypatch, capsys):
    """The bag is written, the report fails: neither is there, and neither is said to be."""
    def full(*arguments):
        raise OSError(28, "No space left on device", "r.html")
    before = content(place)
    monkeypatch.setattr("frac_accel.report.page.write_text", full)
    assert main([*IDENTIFY, "o.yaml", "--report", "r.html", "--json", "r.json"]) == 2
    said = capsys.readouterr()
    assert "No space left" in said.err and "written" not in said.out
    assert content(place) == before
    assert main([*CORRECT, "o.mcap", "--json", "no/folder.json"]) == 2
    assert content(place) == before


def as_from_a_terminal():
    """Take in signals, though the tests were started in the background, which ignores some."""
    for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL)


def start(*arguments, **options):
    return subprocess.Popen([sys.executable, "-m", "frac_accel.cli", *arguments], text=True,
                            env=ENVIRONMENT, stderr=subprocess.PIPE, stdout=subprocess.PIPE,
                            preexec_fn=as_from_a_terminal, **options)


def wait_for(condition, seconds=60):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if found := condition():
            return found
        time.sleep(0.01)
    raise AssertionError("it never came")


def leftovers(folder):
    return [path for path in folder.iterdir() if path.name.endswith(".partial")]


@pytest.fixture
def long_bag(place):
    """A bag on which a correction takes seconds."""
    import numpy as np

    from frac_accel.io.bag import RAW_TOPIC, Samples
    count = 250_000
    raw = np.random.default_rng(1).standard_normal((count, 3))
    write_bag(place / "long.mcap", {RAW_TOPIC: Samples.of(10**18 + np.arange(count) * 10**6, raw)})
    return ["correct", "long.mcap", "--model", "m.yaml", "-o"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
@pytest.mark.parametrize("output", ["o.mcap", "o"])
def test_a_stopped_command_cleans_up(place, long_bag, number, output):
    before = content(place)
    process = start(*long_bag, output)
    wait_for(lambda: leftovers(place))
    process.send_signal(number)
    words = process.communicate(timeout=60)[1]
    assert process.returncode == 128 + number, words
    assert "Traceback" not in words and len(words.strip().splitlines()) == 1
    assert content(place) == before


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_signal_during_a_finalizer_is_not_lost(number):
    """Python drops what is raised there."""
    script = f"""
import os, time
from frac_accel.commands.process import stopping_cleanly
class Finalized:
    def __del__(self):
        os.kill(os.getpid(), {int(number)})
with stopping_cleanly():
    Finalized()
    time.sleep(60)
"""
    process = subprocess.run([sys.executable, "-c", script], env=ENVIRONMENT, timeout=50,
                             capture_output=True, text=True, preexec_fn=as_from_a_terminal)
    assert process.returncode != 0 and "Exception ignored" not in process.stderr
    assert ("KeyboardInterrupt" if number == signal.SIGINT else "Stopped") in process.stderr


def test_what_a_killed_command_left_goes_with_the_next_run(place, long_bag):
    process = start(*long_bag, "o.mcap")
    wait_for(lambda: leftovers(place))
    process.kill()
    process.communicate()
    assert leftovers(place)
    assert main([*CORRECT, "other.mcap"]) == 0
    assert not leftovers(place)


def test_what_a_living_command_holds_is_not_swept(place, long_bag):
    process = start(*long_bag, "o.mcap")
    wait_for(lambda: leftovers(place))
    held = leftovers(place)
    assert main([*CORRECT, "other.mcap"]) == 0
    assert process.poll() is not None or leftovers(place) == held
    assert process.wait(timeout=100) == 0
    assert len(read_bag("o.mcap")) == 2 and not leftovers(place)


def test_a_reader_who_has_seen_enough_changes_nothing(place):
    process = start(*CORRECT, "o.mcap", "--json", "r.json")
    process.stdout.close()
    assert process.wait(timeout=60) == 0
    assert process.stderr.read() == ""
    assert Path("o.mcap").exists() and Path("r.json").exists()


def test_a_full_disk_behind_standard_output_is_one_line(place):
    before = content(place)
    with open("/dev/full", "w") as full:
        process = subprocess.run([sys.executable, "-m", "frac_accel.cli", *CORRECT, "o.mcap"],
                                 stdout=full, stderr=subprocess.PIPE, env=ENVIRONMENT, text=True)
    assert process.returncode == 2
    line, = process.stderr.strip().splitlines()
    assert line == "frac_accel correct: No space left on device"
    assert content(place) == before


def test_an_unforeseen_error_is_one_line_and_a_file_with_the_details(place, monkeypatch, capsys,
                                                                    tmp_path):
    import tempfile

    from frac_accel.commands import validate
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def broken(arguments):
        outputs.write_text("r.json", "half")
        raise IndexError("a secret of the data")
    before = content(place)
    monkeypatch.setattr(validate, "run", broken)
    assert main(["validate", "in.mcap", "--model", "m.yaml", "--json", "r.json"]) == 3
    line, = capsys.readouterr().err.strip().splitlines()
    assert "IndexError" in line and "secret" not in line
    details = Path(line.split("details: ")[1])
    assert details.parent == tmp_path and details.stat().st_mode & 0o077 == 0
    text = details.read_text()
    assert "Traceback" in text and "in.mcap --model m.yaml" in text and "secret" in text
    assert content(place) == before


def test_too_little_memory_is_one_line(place, monkeypatch, capsys):
    def greedy(arguments):
        raise MemoryError
    from frac_accel.commands import validate
    monkeypatch.setattr(validate, "run", greedy)
    assert main(["validate", "in.mcap", "--model", "m.yaml"]) == 2
    assert "not enough memory" in capsys.readouterr().err


@pytest.mark.parametrize("report", [[], ["--report", "r.html"]])
def test_names_that_are_not_utf_8(place, report):
    name = os.fsdecode(b"caf\xe9.mcap")
    os.rename("in.mcap", name)
    output = os.fsdecode(b"\xe9.yaml")
    process = start("identify", name, "-o", output, "--json", os.fsdecode(b"\xe9.json"), *report)
    out, err = process.communicate(timeout=100)
    assert process.returncode == 0, err
    assert "\\udce9.yaml: written" in out
    assert main(["validate", name, "--model", output]) == 0
    assert not leftovers(place)
    if report:
        assert "caf\\udce9.mcap" in Path("r.html").read_text(encoding="utf-8")
    process = start("validate", os.fsdecode(b"none\xe9.mcap"), "--model", output)
    assert "none\\udce9.mcap: no such bag" in process.communicate(timeout=100)[1]
    assert process.returncode == 2


@pytest.mark.parametrize("arguments", [
    ["convert", "in.mcap", "-o", b"\xfe.csv"], ["convert", "in.mcap", "-o", b"\xfe.parquet"],
    ["fleet", "correct", b"caf\xe9.mcap", "--model", "m.yaml", "-o", "results"],
    ["fleet", "correct", "in.mcap", "--model", "m.yaml", "-o", b"\xfe"]])
def test_names_that_other_libraries_cannot_have_are_refused(place, arguments, capsys):
    pytest.importorskip("fsspec" if arguments[0] == "fleet" else "pyarrow")
    os.link("in.mcap", os.fsdecode(b"caf\xe9.mcap"))
    before = sorted(os.listdir(place))
    assert main([os.fsdecode(part) for part in arguments]) == 2
    line, = capsys.readouterr().err.splitlines()
    assert "UTF-8" in line
    assert sorted(os.listdir(place)) == before


def test_main_leaves_signals_as_it_found_them(place):
    before = [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)]
    assert cli.main(["validate", "in.mcap", "--model", "m.yaml"]) == 0
    assert before == [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)]
