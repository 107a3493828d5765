"""Every write of every command fails in turn, by a full disk and by lack of memory.

As SQLite tests it (https://sqlite.org/testing.html, 3.1 and 3.2): the k-th call fails, for k = 1, 2
and so on until the command gets through.
"""

import builtins
import errno
import importlib
import io
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from fuzz import case, seeds

from frac_accel.cli import main
from frac_accel.io.bag import write_bag

COMMANDS = {
    "simulate": ["in.mcap", "--model", "m.yaml", "-o", "o.mcap", "--json", "r.json"],
    "simulate, folder": ["in.mcap", "--model", "m.yaml", "-o", "new", "--json", "r.json"],
    "correct": ["in.mcap", "--model", "m.yaml", "-o", "o.mcap", "--json", "r.json"],
    "correct, folder": ["in.mcap", "--model", "m.yaml", "-o", "new"],
    "validate": ["in.mcap", "--model", "m.yaml", "--json", "r.json"],
    "identify": ["in.mcap", "--structure", "oscillator", "-o", "o.yaml", "--json", "r.json",
                 "--report", "r.html"],
    "diagnose": ["in.mcap", "--model", "m.yaml", "--extended-model", "o.yaml", "--json", "r.json",
                 "--report", "r.html"],
    "budget": ["in.mcap", "--model", "m.yaml", "--json", "r.json"],
    "paper": ["--quick", "--json", "r.json", "--report", "r.html"],
}
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


OPEN = io.open


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
                        ("simulation", "simulate"), ("budget", "left_by"),
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
    if command == "paper" and (existing or error != "disk full"):
        pytest.skip("its page takes seconds, and is written as that of the others")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TQDM_DISABLE", "1")
    write_bag("in.mcap", seeds.samples(np.random.default_rng(1), {
        **seeds.PLAIN, "effects": [{"cause": "cubic_stiffness", "alpha3": 1e-4}]}))
    Path("m.yaml").write_text(seeds.text_of(seeds.PLAIN))
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
    assert {command.split(",")[0] for command in COMMANDS} == {*case.SHARES, "paper"}
