"""One case: a model file, damaged or not, for a corrector at work, as the node's ``model_file``.

What the node does in a process beside it happens here in the same one, with its deadline.
"""

import signal

import numpy as np

from frac_accel import Corrector, SensorModel
from frac_accel.errors import FracAccelError
from frac_accel.streaming import apart

from . import seeds
from .case import model_file

DEADLINE_S = 10
DAMAGES = {"model tree": 0.35, "model text": 0.2, "model sizes": 0.3, "nothing": 0.15}
BLOCK = 300


class _TooLong(Exception):
    pass


def judge(number, folder):
    """Try one model, as `runner.judge` runs one command.

    Returns
    -------
    what : str
    status : str
        ``accepted``, ``refused`` or ``gave up`` (the deadline).
    wrong : list of str
    """
    rng = np.random.default_rng([number, 1])
    what = str(rng.choice(list(DAMAGES), p=list(DAMAGES.values())))
    path = folder / "m.yaml"
    path.write_bytes(model_file(what, rng))
    old = SensorModel.from_dict(seeds.PLAIN)
    kernel, twin = (Corrector(old, seeds.RATE_HZ, noise_std=1e-3) for _ in range(2))
    _process(kernel, 0), _process(twin, 0)
    wrong = []
    status, words = _exchange(kernel, path)
    with np.errstate(all="ignore"):
        result, expected = _process(kernel, 1), _process(twin, 1)
    if status == "accepted":
        if not np.isfinite(result.values).all() or not (result.variance >= 0).all():
            wrong.append("gives out what is no number")
    else:
        if not 20 < len(words) < 3000 or "\n" in words.strip():
            wrong.append(f"refused by {words[:300]!r}")
        if kernel.model is not old or any(
                getattr(result, name).tobytes() != getattr(expected, name).tobytes()
                for name in ("index", "stamps_ns", "values", "variance")):
            wrong.append("the old model is not at work")
    if kernel.counters["samples"] != 2 * BLOCK:
        wrong.append(f"samples are lost: {kernel.counters}")
    return f"live, {what}", status, wrong


def _exchange(kernel, path):
    def too_long(*_):
        raise _TooLong
    before = signal.signal(signal.SIGPROF, too_long)
    signal.setitimer(signal.ITIMER_PROF, DEADLINE_S)
    try:
        model, _, designs = apart.attempt(str(path), (seeds.RATE_HZ,), {})
        signal.setitimer(signal.ITIMER_PROF, 0)
        kernel.prepare(model, designs[seeds.RATE_HZ])
        kernel.replace(model)
        return "accepted", ""
    except FracAccelError as error:
        return "refused", str(error)
    except _TooLong:
        return "gave up", f"{path}: longer than {DEADLINE_S} s"
    except Exception as error:  # the process says the same of it
        return "refused", f"{path}: no filter can be designed: {type(error).__name__}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def _process(kernel, block):
    rng = np.random.default_rng(block)
    stamps = seeds.START_NS + (block * BLOCK + np.arange(BLOCK)) * 1_000_000
    return kernel.process(stamps, rng.normal(size=(BLOCK, 3)))
