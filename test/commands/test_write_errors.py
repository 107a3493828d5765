"""Every write of every command fails in turn, by a full disk and by lack of memory.

As SQLite tests it (https://sqlite.org/testing.html, 3.1 and 3.2): the k-th call fails, for k = 1, 2
and so on until the command gets through.
"""

import builtins
import errno
import importlib
import io
import json
import os
import re
import resource
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from fuzz import seeds

from frac_accel.cli import VERBS, main
from frac_accel.io.bag import write_bag

COMMANDS = {
    "simulate": ["in.mcap", "--model", "m.yaml", "-o", "o.mcap", "--json", "r.json"],
    "simulate, folder": ["in.mcap", "--model", "m.yaml", "-o", "new", "--json", "r.json"],
    "correct": ["in.mcap", "--model", "m.yaml", "-o", "o.mcap", "--json", "r.json"],
    "correct, folder": ["in.mcap", "--model", "m.yaml", "-o", "new"],
    "correct, page": ["in.mcap", "--model", "m.yaml", "-o", "o.mcap", "--report", "r.html"],
    "validate": ["in.mcap", "--model", "m.yaml", "--json", "r.json", "--report", "r.html"],
    "convert": ["in.mcap", "-o", "o.mcap", "--json", "r.json"],
    "convert, folder": ["in.mcap", "-o", "new"],
    "convert, npz": ["in.mcap", "-o", "o.npz", "--json", "r.json"],
    "identify": ["in.mcap", "--structure", "oscillator", "-o", "o.yaml", "--json", "r.json",
                 "--report", "r.html"],
    "diagnose": ["in.mcap", "--model", "m.yaml", "--extended-model", "o.yaml", "--json", "r.json",
                 "--report", "r.html"],
    "budget": ["in.mcap", "--model", "m.yaml", "--json", "r.json"],
    "report": ["found.json", "-o", "r.html"],
    "layout": ["foxglove", "-o", "o.json"],
    "bench": ["kernel", "--rounds", "1", "--json", "r.json"],
    "paper": ["--quick", "--json", "r.json", "--report", "r.html"],
}
# Verbs that are not there, with the reason.
WITHOUT = {"watch": "it writes no file", "completion": "it writes no file",
           "fleet": "rows that are done stay: a test of its own, below"}
# What writes, by module; files are counted write by write.
CALLS = {os: ("fsync", "replace", "mkdir")}


class Failing:
    """Counts calls; the chosen one fails."""

    def __init__(self, error):
        self.error = error
        self.chosen = 0
        self.count = 0

    def call(self):
        self.count += 1
        if self.count == self.chosen:
            raise self.error

    def wrapped(self, function):
        def wrapper(*arguments, **options):
            # a folder that is there already needs no room
            if not (function is MKDIR and os.path.isdir(arguments[0])):
                self.call()
            return function(*arguments, **options)
        return wrapper

    def open(self, file, mode="r", buffering=-1, encoding=None, errors=None, newline=None,
             closefd=True, opener=None):
        if not set(mode) & set("wxa"):
            return OPEN(file, mode, buffering, encoding, errors, newline, closefd, opener)
        self.call()
        raw = _File(file, mode.replace("b", "").replace("t", ""))
        raw.call = self.call
        buffered = io.BufferedWriter(raw)
        return buffered if "b" in mode else io.TextIOWrapper(buffered, encoding, errors, newline)


class _File(io.FileIO):
    def write(self, data):
        self.call()
        return super().write(data)


OPEN, MKDIR = io.open, os.mkdir


@pytest.fixture
def failing(monkeypatch):
    def start(error):
        fault = Failing(error)
        for module, names in CALLS.items():
            for name in names:
                monkeypatch.setattr(module, name, fault.wrapped(getattr(module, name)))
        for module in (builtins, io):
            monkeypatch.setattr(module, "open", fault.open)
        return fault
    yield start
    monkeypatch.undo()


def compute_once(monkeypatch):
    """The work before the writing is the same each time."""
    for where, name in (("identification", "identify"), ("diagnosis", "diagnose"),
                        ("paper", "reproduce"), ("validation", "validate"),
                        ("simulation", "simulate"), ("budget", "left_by"), ("bench.kernel", "run"),
                        # first: it has the name from the module after it
                        ("commands._correct_page", "correction_page"),
                        ("report.correction", "correction_page"),
                        ("report.identification", "identification_page"),
                        ("report.diagnosis", "diagnosis_page"), ("report.paper", "paper_page")):
        module = importlib.import_module(f"frac_accel.{where}")
        monkeypatch.setattr(module, name, _once(getattr(module, name)))


def _once(function):
    results = []

    def once(*arguments, **options):
        if not results:
            results.append(function(*arguments, **options))
        return results[0]
    return once


def content(folder):
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
            for path in folder.rglob("*")}


ERRORS = {"disk full": OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)),
          "input/output error": OSError(errno.EIO, os.strerror(errno.EIO)),
          "memory": MemoryError()}


@pytest.mark.parametrize("existing", [False, True], ids=["new", "replaced"])
@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize("command", COMMANDS)
def test_a_write_that_fails_leaves_everything_as_it_was(command, error, existing, tmp_path,
                                                        monkeypatch, capsys, failing):
    if existing and error == "input/output error":
        pytest.skip("as a full disk")
    if command in ("paper", "bench") and (existing or error != "disk full"):
        pytest.skip("it takes seconds, and writes as the others do")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TQDM_DISABLE", "1")
    # bench says how busy the machine is
    monkeypatch.setattr(os, "getloadavg", lambda: (0.0, 0.0, 0.0))
    write_bag("in.mcap", seeds.samples(np.random.default_rng(1), {
        **seeds.PLAIN, "effects": [{"cause": "cubic_stiffness", "alpha3": 1e-4}]}))
    Path("m.yaml").write_text(seeds.text_of(seeds.PLAIN))
    if command == "report":
        Path("found.json").write_text(json.dumps(seeds.results()[0]))
    arguments = [command.split(",")[0], *COMMANDS[command]]
    outputs = [name for name in arguments if name.startswith(("o.", "r.")) or name == "new"]
    for name in outputs if existing else ():
        if name != "new":
            Path(name).write_text(f"an old {name}")
    before = content(tmp_path)
    compute_once(monkeypatch)
    # what is loaded and compiled at first use is no part of the writing
    assert main([part if part not in outputs else f"first_{part}" for part in arguments]) == 0
    for path in tmp_path.glob("first_*"):
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    fault = failing(ERRORS[error])
    while True:
        fault.count, fault.chosen = 0, fault.chosen + 1
        capsys.readouterr()
        status = main(arguments)
        said = capsys.readouterr()
        if fault.count < fault.chosen:
            break
        assert status == 2, said.err
        line, = [line for line in said.err.splitlines() if not line.startswith("note: ")]
        assert ("enough memory" if error == "memory" else ERRORS[error].strerror) in line
        assert "written" not in said.out
        assert content(tmp_path) == before
    assert status == 0 and fault.chosen > 4
    for name in outputs:
        assert Path(name).is_dir() if name == "new" else Path(name).stat().st_size > 100
    assert set(content(tmp_path)) >= {*before, *outputs}
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_every_command_is_here():
    assert {command.split(",")[0] for command in COMMANDS} == VERBS.keys() - WITHOUT.keys()


@pytest.mark.parametrize("error", ["disk full", "memory"])
def test_a_fleet_goes_on_from_any_write_that_fails(error, tmp_path, monkeypatch, capsys, failing):
    """What is done stays, nothing is half there, and the same command completes it."""
    pytest.importorskip("pyarrow")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TQDM_DISABLE", "1")
    write_bag("in.mcap", seeds.samples(np.random.default_rng(1)))
    Path("m.yaml").write_text(seeds.text_of(seeds.PLAIN))

    def run(results):
        capsys.readouterr()
        status = main(["fleet", "correct", "in.mcap", "--model", "m.yaml", "-o", results, "--map",
                       "builtins:map"])
        return status, capsys.readouterr().err.splitlines()

    assert run("first") == (0, [])
    usual = sorted(re.sub("-[0-9a-f]{32}", "", name).replace("first", "results")
                   for name in content(tmp_path) if name.startswith("first"))
    inputs = {name: told for name, told in content(tmp_path).items() if "first" not in name}
    fault = failing(ERRORS[error])
    while True:
        fault.count, fault.chosen = 0, fault.chosen + 1
        status, said = run("results")
        if fault.count < fault.chosen:
            break
        # a bag that takes too much memory is done with, a full disk will have room
        assert status == 2 and len(said) == 1 or error == "memory" and (status, said) == (4, [])
        fault.chosen, chosen = -1, fault.chosen
        assert run("results") == (0 if status == 2 else 4, [])
        if status == 4:
            shutil.rmtree("results")
            fault.chosen = chosen
            continue
        names = [name for name in content(tmp_path) if name.startswith("results")]
        assert sorted({re.sub("-[0-9a-f]{32}", "", name) for name in names}) == usual
        assert inputs.items() <= content(tmp_path).items()
        shutil.rmtree("results")
        fault.chosen = chosen
    assert status == 0 and fault.chosen > 10


@pytest.mark.parametrize("output", ["o.mcap", "o.csv", "o.parquet", "o.npz", "o.db3", "o.mf4",
                                    "new"])
def test_a_disk_that_is_full_behind_any_library_leaves_nothing(output, tmp_path, monkeypatch):
    """Files may not grow beyond a size: libraries that do not write by Python are told so, too."""
    pytest.importorskip("pyarrow")
    pytest.importorskip("asammdf")
    monkeypatch.chdir(tmp_path)
    write_bag("in.mcap", seeds.samples(np.random.default_rng(1)))
    before = content(tmp_path)
    status, said = in_child(["convert", "in.mcap", "-o", output, "--json", "r.json"])
    assert status == 0, said
    made = Path(output)
    size = max(path.stat().st_size for path in (made.iterdir() if made.is_dir() else [made]))
    shutil.rmtree(made) if made.is_dir() else made.unlink()
    Path("r.json").unlink()
    # each takes a process of its own for .mf4
    for most in (0, size // 2, size - 1)[:1 if output == "o.mf4" else None]:
        status, said = in_child(["convert", "in.mcap", "-o", output, "--json", "r.json"], most)
        assert status == 2, (most, said)
        line, = said.splitlines()
        assert line.startswith("frac_accel convert: ") and len(line) > 40
        assert content(tmp_path) == before


def in_child(arguments, most_bytes=resource.RLIM_INFINITY):
    """Exit status and what was said by a command whose files may not be larger."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        status = 70
        try:
            os.environ["TQDM_DISABLE"] = "1"
            sys.stderr = open(writing, "w")
            sys.stdout = open(os.devnull, "w")
            resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, resource.RLIM_INFINITY))
            status = main(arguments)
            sys.stderr.flush()
        finally:
            os._exit(status)
    os.close(writing)
    with open(reading) as stream:
        said = stream.read()
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), said
