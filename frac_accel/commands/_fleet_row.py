"""One bag through one verb, as a row: what the workers of a fleet run."""

import argparse
import contextlib
import contextvars
import errno
import importlib
import io
import json
import os
import platform
import resource
import sys
import tempfile
import time

from ..errors import FracAccelError
from ..fleet.places import at_hand, output_at
from ..fleet.workers import package_version
from ..io.outputs import together
from ._common import one_line, write_json
from .report import page_of

# What a verb writes beside its result.
_OUTPUTS = {"correct": ".mcap", "identify": ".yaml"}
# Verdicts whose page is drawn.
_UNREMARKABLE = ("consistent", "insufficient_data")


def row(task):
    """One bag through one verb: from bag to row, the public function that `--map` is given.

    Parameters
    ----------
    task : dict
        Plain data: ``verb``; ``bag``, its URL; ``arguments``, the verb's options as on a command
        line; ``axis`` or an empty text; ``results``, the folder for what the verb writes;
        ``name``, the stem of those files; ``pages``, whether a page is drawn; and what else the
        row is to carry in ``carried``.

    Returns
    -------
    dict
        The columns of `frac_accel.fleet.store.COLUMNS` that the verb tells; ``error`` is empty
        where it went well, and ``is_fatal`` true where no other bag would do better (a full disk).
        It never raises.

    Examples
    --------
    >>> from frac_accel.commands.fleet import row
    >>> told = row({"verb": "diagnose", "bag": "bags/soft_mount.mcap", "axis": "x",
    ...             "arguments": ["--model", "bags/soft_mount.yaml"]})
    >>> told["verdict"], told["causes"]
    ('explained', ['time_delay', 'cubic_stiffness'])
    """
    # the outputs of a caller's command are not ours
    return contextvars.Context().run(_row, task)


def _row(task):
    import numpy
    import scipy
    began_s, cpu_s = time.monotonic(), time.process_time()
    told = {**task.get("carried", {}), "bag": task["bag"], "verb": task["verb"],
            "axis": task.get("axis", ""), "error": "", "is_fatal": False}
    try:
        told.update(_told(task))
    except FracAccelError as error:
        told["error"] = one_line(error)
        told["is_fatal"] = _is_full(error)
    except MemoryError:
        told["error"] = "there is not enough memory for this bag"
    except OSError as error:
        told["error"] = f"{error.filename or task['bag']}: {error.strerror or error}"
        told["is_fatal"] = _is_full(error)
    except SystemExit:
        told["error"] = f"the options are not those of {task['verb']}"
    except Exception as error:  # one bag must not end the work on the others
        told["error"] = f"an error that nobody has foreseen: {type(error).__name__}: {error}"
    return {**told, **_costs(began_s, cpu_s), "frac_accel": package_version(),
            "numpy": numpy.__version__, "scipy": scipy.__version__,
            "python": sys.version.split()[0]}


def _is_full(error):
    """Whether an error comes from a disk that takes no more."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EROFS):
            return True
        error = error.__context__
    return False


def _told(task):
    verb = task["verb"]
    module = importlib.import_module(f".{verb}", __package__)
    parser = argparse.ArgumentParser(prog=f"frac_accel {verb}")
    module.add_arguments(parser)
    with contextlib.ExitStack() as places:
        folder = places.enter_context(tempfile.TemporaryDirectory(prefix="frac_accel-row-"))
        bag = places.enter_context(at_hand(task["bag"]))
        result = os.path.join(folder, "result.json")
        line = [str(bag), *task["arguments"], "--json", result]
        line += ["--axis", task["axis"]] if task.get("axis") else []
        if task.get("model_text"):
            model = os.path.join(folder, task["model"])
            with open(model, "w", encoding="utf-8") as file:
                file.write(task["model_text"])
            line += ["--model", model]
        written = {}
        if verb in _OUTPUTS and task.get("results"):
            written["output"] = f"{verb}-files/{task['name']}{_OUTPUTS[verb]}"
            line += ["-o", places.enter_context(
                output_at(f"{task['results']}/{written['output']}"))]
        elif verb in _OUTPUTS:
            line += ["-o", os.path.join(folder, f"output{_OUTPUTS[verb]}")]
        if verb == "diagnose":
            line.append("--screened")
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            with together():
                module.run(parser.parse_args(line))
        with open(result, encoding="utf-8") as file:
            data = json.load(file)
    told = {**_TOLD[verb](data), **written}
    if task.get("results") and verb in ("diagnose", "identify"):
        told.update(_kept(task, data))
    return told


def _kept(task, data):
    """Result and page of one bag, beside the rows."""
    kept = {"result": f"{task['verb']}-files/{task['name']}.json"}
    with output_at(f"{task['results']}/{kept['result']}") as path:
        write_json(path, data)
    if task.get("pages") and data.get("verdict") not in _UNREMARKABLE:
        kept["page"] = f"{task['verb']}-files/{task['name']}.html"
        with output_at(f"{task['results']}/{kept['page']}") as path:
            page_of(data).write(path)
    return kept


def _of_diagnosis(data):
    screened = data.get("screened") or {"estimates": [], "correlations": []}
    return {
        **{key: data[key] for key in ("verdict", "reason", "cut_off", "unexplained_fraction")},
        "baseline_rmse": data["baseline"]["rmse"], "baseline_nrmse": data["baseline"]["nrmse"],
        "noise_rms": data["baseline"]["noise_rms"], "extended_rmse": data["extended"]["rmse"],
        "extended_nrmse": data["extended"]["nrmse"],
        "established_noise_rms": data["established_noise"]["rms"],
        "causes": [finding["cause"] for finding in data["findings"]],
        "parameters": [
            {"cause": finding["cause"], "parameter": name, **_numbers(entry),
             "reduction": finding["gain"]["reduction"], "confidence": finding["confidence"]}
            for finding in data["findings"] for name, entry in finding["parameters"].items()],
        "budget": [{"part": entry["part"], "of": entry["of"], "share": entry["share"],
                    "low": entry["ci95"][0], "high": entry["ci95"][1]} for entry in data["budget"]],
        "notes": data["integrity"], **screened}


def _numbers(entry):
    """A parameter; what is a word (the family of a filter) has no value."""
    value = entry["value"] if isinstance(entry["value"], (int, float)) else None
    unit = entry["unit"] if value is not None else str(entry["value"])
    return {"value": value, "std": entry["std"], "unit": unit}


def _of_identification(data):
    return {"structure": data["structure"], "nrmse": data["nrmse"],
            "held_out_nrmse": data["held_out_nrmse"], "notes": data["notes"],
            "parameters": [{"cause": "", "parameter": name, **_numbers(entry)}
                           for name, entry in data["parameters"].items()]}


def _of_validation(data):
    return {"nrmse": data["simulation"]["total"]["nrmse"],
            "scaled_nrmse": data["scaled"]["total"]["nrmse"],
            "corrected_nrmse": data["corrected"]["total"]["nrmse"],
            "counters": _counters(data["counters"])}


def _of_correction(data):
    return {"counters": _counters(data["counters"]), "notes": data["warnings"]}


def _counters(counters):
    return [{"name": name, "count": count} for name, count in counters.items()]


_TOLD = {"diagnose": _of_diagnosis, "identify": _of_identification, "validate": _of_validation,
         "correct": _of_correction}


def _costs(began_s, cpu_s):
    return {"wall_s": time.monotonic() - began_s, "cpu_s": time.process_time() - cpu_s,
            # the most that this worker has had, in this bag or an earlier one
            "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024e-6,
            "worker": f"{platform.node()}:{os.getpid()}"}
