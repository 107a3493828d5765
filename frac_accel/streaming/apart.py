"""A model loaded and its filters designed in a process of its own, which can be ended.

A file can make reading or design take as long as it likes, and a thread cannot be stopped; in a
process beside the one that corrects, it costs that one nothing but a wait.
"""

import os
import pickle
import subprocess
import sys

from ..errors import DesignError, FracAccelError

# Most memory [bytes] that the process may take.
_MEMORY = 2 << 30
# Samples that each filter has to give out before it counts as sound.
_TRIED = 64


def design_apart(model_file, rates_hz, wishes, deadline_s):
    """Load a model and design its correction, within a time.

    Parameters
    ----------
    model_file : str
    rates_hz : iterable of float
        Sampling rates [Hz] to design for; none: the model is only loaded.
    wishes : dict
        As for `Corrector`.
    deadline_s : float
        After so long [s] the attempt is given up.

    Returns
    -------
    model : SensorModel
    model_hash : str
        SHA-256 of the file.
    designs : dict of float to FilterDesign
        By sampling rate.

    Raises
    ------
    FracAccelError
        Whatever is wrong with the file or the design, or if it takes too long.
    """
    request = pickle.dumps((str(model_file), tuple(rates_hz), wishes))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    try:
        done = subprocess.run([sys.executable, "-m", __name__], input=request, env=environment,
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                              timeout=deadline_s, check=False)
    except subprocess.TimeoutExpired:
        raise DesignError(f"{model_file}: loading the model and designing its filter took longer "
                          f"than {deadline_s:g} s") from None
    except OSError as error:
        raise DesignError(f"{model_file}: no process to design in: {error.strerror}") from None
    if done.returncode:
        raise DesignError(f"{model_file}: loading the model or designing its filter failed: it "
                          "takes too much memory or time")
    # what our own program has written
    refusal, result = pickle.loads(done.stdout)
    if refusal:
        raise FracAccelError(refusal)
    return result


def _attempt(model_file, rates_hz, wishes):
    from ..model import SensorModel
    model, model_hash = SensorModel.load_with_hash(model_file)
    return model, model_hash, {rate: _sound_design(model, rate, wishes) for rate in rates_hz}


def _sound_design(model, rate_hz, wishes):
    """Design of a filter that has been seen to give out numbers."""
    import numpy as np

    from .corrector import Corrector
    kernel = Corrector(model, rate_hz, noise_std=1e-3, **wishes)
    count = kernel.design.warm_up_samples + _TRIED
    stamps = np.round(np.arange(count) * 1e9 / rate_hz).astype(np.int64)
    with np.errstate(all="ignore"):
        result = kernel.process(stamps, 1e-3 * np.random.default_rng(0).normal(size=(count, 3)))
    if not (np.isfinite(result.values).all() and np.isfinite(result.variance).all()):
        raise DesignError("the filter of this model does not give finite numbers")
    return kernel.design


def main():
    """Answer the request on the standard input."""
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    # the linear algebra library writes to the standard output what it does not like
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    request = pickle.loads(sys.stdin.buffer.read())
    try:
        answer = pickle.dumps(("", _attempt(*request)))
    except FracAccelError as error:
        answer = pickle.dumps((str(error), None))
    except Exception as error:  # whatever it is, it is a refusal
        answer = pickle.dumps((f"{request[0]}: no filter can be designed for this model: "
                               f"{type(error).__name__}", None))
    out.write(answer)
    out.flush()


if __name__ == "__main__":
    main()
