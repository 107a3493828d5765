"""Runs cases in a child with limits, and says what is wrong with how a command took one."""

import contextlib
import faulthandler
import hashlib
import io
import json
import multiprocessing
import os
import resource
import shutil
import signal
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

from frac_accel import SensorModel
from frac_accel.cli import main
from frac_accel.io.bag import BagReader

from . import seeds
from .case import make

MOST_SECONDS = 20
MOST_BYTES = 2**30
_HANGS = 300
"""Seconds [s] of the wall's clock after which a child is taken to hang."""


def judge(number, folder):
    """Run one case in this process.

    Returns
    -------
    what : str
        The case.
    status : int or None
    wrong : list of str
        What must not be; empty if all is well.
    """
    arguments, outputs, what = make(number, folder)
    before = _contents(folder)
    start = time.process_time()
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), \
            warnings.catch_warnings():
        # numpy's words about overflow are no part of a command's answer
        warnings.simplefilter("ignore")
        try:
            status = main(arguments)
        except SystemExit as error:
            status = error.code
    seconds = time.process_time() - start
    said = [line for line in err.getvalue().splitlines() if not line.startswith("warning: ")]
    after = _contents(folder)
    if status == 0:
        # what was there under an output's name
        before = {name: told for name, told in before.items()
                  if folder / name not in outputs}
    wrong = []
    if status not in (0, 2):
        wrong.append(f"status {status}: {' '.join(said)[-300:]}")
    if status == 2 and not (len(said) == 1 and said[0].startswith(f"frac_accel {arguments[0]}: ")
                            and 20 < len(said[0]) < 3000):
        wrong.append(f"refused in {len(said)} lines: {err.getvalue()[-500:]!r}")
    if "enough memory" in err.getvalue():
        wrong.append(f"more than {MOST_BYTES >> 20} MiB")
    if "Traceback" in err.getvalue() + out.getvalue():
        wrong.append("traceback")
    if seconds > MOST_SECONDS:
        wrong.append(f"{seconds:.0f} s")
    if {name: after.get(name) for name in before} != before:
        wrong.append("inputs changed")
    made = {name.split("/")[0] for name in after if name not in before}
    expected = {path.name for path in outputs} if status == 0 else set()
    # there may be nothing to extend
    if made - expected or expected - made - {"extended.yaml"}:
        wrong.append(f"made {sorted(made)}, expected {sorted(expected)}")
    wrong += [f"output {path.name}: {trouble}" for path in outputs
              if status == 0 for trouble in [_trouble(path)] if trouble]
    return what, status, wrong


def _contents(folder):
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
            if path.is_file() else None for path in sorted(folder.rglob("*"))}


def _trouble(path):
    """Why an output cannot be used by the next command."""
    try:
        if not path.exists():
            return ""
        if path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix == ".yaml":
            SensorModel.load(path)
        elif path.suffix != ".html":
            # topics are copied as they are, malformed messages too: they need not be samples
            sum(1 for _ in BagReader(path).messages())
    except Exception as error:
        return f"{type(error).__name__}: {error}"[:300]
    return ""


def run(numbers, keep=None, told=lambda number, what, status, wrong: None, judging=judge):
    """Judge cases, in a child that is replaced when one kills it.

    Parameters
    ----------
    numbers : iterable of int
    keep : Path, optional
        Folder for the inputs of cases with which something is wrong.
    told : callable, optional
        Gets each case's number, what it is, the exit status and what is wrong.
    judging : callable
        `judge`, or that of `live`.

    Returns
    -------
    dict of int to list of str
        What is wrong, by case; those with which nothing is are left out.
    """
    found = {}
    child = _Child(judging)
    try:
        for number in numbers:
            with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
                what, status, wrong = child.judge(number, folder)
                told(number, what, status, wrong)
                if wrong:
                    found[number] = [what, *wrong]
                    if keep:
                        shutil.copytree(folder, Path(keep) / str(number), dirs_exist_ok=True)
                        (Path(keep) / str(number) / "wrong.txt").write_text("\n".join(
                            [what, *wrong]))
    finally:
        child.end()
    return found


class _Child:
    def __init__(self, judging):
        self._judging = judging
        self._context = multiprocessing.get_context("fork")
        _warm_up()
        self._start()

    def _start(self):
        self._ours, theirs = self._context.Pipe()
        self._process = self._context.Process(target=_serve, args=(theirs, self._judging),
                                              daemon=True)
        self._process.start()
        theirs.close()

    def judge(self, number, folder):
        self._ours.send((number, folder))
        try:
            if self._ours.poll(_HANGS):
                return self._ours.recv()
            wrong = f"hangs for {_HANGS} s"
        except EOFError:
            self._process.join()
            code = -(self._process.exitcode or 0)
            wrong = (f"more than {MOST_SECONDS} s" if code == signal.SIGXCPU else
                     f"ended by {signal.Signals(code).name}" if code > 0 else f"exits with {-code}")
        self.end()
        self._start()
        return "?", None, [wrong]

    def end(self):
        self._process.kill()
        self._process.join()
        self._ours.close()


def _warm_up():
    """Compile and load what the first case would pay for."""
    # a bar is for eyes; read when tqdm is loaded
    os.environ["TQDM_DISABLE"] = "1"
    rng = np.random.default_rng(0)
    model = {**seeds.PLAIN, "effects": [
        {"cause": "cubic_stiffness", "alpha3": 1e-6}, {"cause": "coulomb_friction", "level": 1e-3},
        {"cause": "hysteresis", "strength": 0.1, "beta": 1.0, "gamma": 0.0}]}
    seeds.samples(rng, model, 100)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        seeds.results()


def _serve(pipe, judging):
    """Judge what the pipe asks for, within the limits."""
    faulthandler.disable()
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * os.sysconf("SC_PAGE_SIZE") + MOST_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    while True:
        try:
            number, folder = pipe.recv()
        except EOFError:
            return
        spent = resource.getrusage(resource.RUSAGE_SELF)
        resource.setrlimit(resource.RLIMIT_CPU, (
            int(spent.ru_utime + spent.ru_stime) + MOST_SECONDS + 2, resource.RLIM_INFINITY))
        pipe.send(judging(number, Path(folder)))
