"""One trial: draw a case, have it diagnosed, keep what the judge needs."""

import time

import numpy as np

from frac_accel import SensorModel, simulate
from frac_accel.errors import FracAccelError
from frac_accel.model.core import Oscillator
from frac_accel.model.effects import known_effects

# Groups whose correction is judged; the roads' rates and noise are no matter of the sensor.
CORRECTED = ("single", "multiple")


def warm_up():
    """Compile what is compiled on a machine's first use, which no diagnosis is to be timed with."""
    core = Oscillator(100.0, 0.7)
    for cause in "cubic_stiffness", "coulomb_friction":
        simulate(SensorModel(core, [known_effects()[cause](1e-3)]), np.eye(1, 256)[0], 1000.0, "x")


def run(trial, diagnose=None):
    """Row of one trial, of plain values.

    A refusal (`FracAccelError`) is a result; any other exception is one too, as a crash, so that
    one of them does not end a suite of hours.

    Parameters
    ----------
    trial : Trial
    diagnose : callable, optional
        Default: `frac_accel.diagnose`.
    """
    if diagnose is None:
        from frac_accel import diagnose
    case = trial.case()
    reference, sensor, temperature = case.samples()
    row = {**trial._asdict(), "causes": tuple(sorted(case.causes)), "hidden": trial.causes,
           "besides": case.besides, "kind": case.kind, "excitation": case.excitation,
           "samples": len(sensor.stamps_ns), "truth": case.truth, "core": case.baseline.core,
           "strength": {cause: rms / case.noise_std for cause, rms in case.effect_rms.items()},
           "oracle_rmse": oracle_rmse(case), "verdict": None, "error": None, "findings": {},
           "extended_rmse": None, "correction": None}
    begin = time.process_time()
    try:
        model = None if trial.group == "without_model" else case.model()
        found = diagnose((reference, sensor), model=model, axis="x", temperature=temperature)
        row["cpu_s"] = time.process_time() - begin
        result = found.as_dict()
    except FracAccelError as error:
        return {**row, "cpu_s": time.process_time() - begin, "error": f"refused: {error}"}
    except Exception as error:  # whatever it is, it counts against the diagnosis
        return {**row, "cpu_s": time.process_time() - begin,
                "error": f"crashed: {type(error).__name__}: {error}"}
    row["verdict"] = result["verdict"]
    row["findings"] = {finding["cause"]: finding["parameters"] for finding in result["findings"]}
    row["extended_rmse"] = _finite(result["extended"]["rmse"])
    if trial.group in CORRECTED and result["findings"]:
        row["correction"] = corrections(case, found.model)
    return row


def oracle_rmse(case):
    """Error on axis x of the true sensor with its true parameters: what no fit can go below.

    Clipping and quantisation act on the noise too: the oracle applies them to what it knows.
    """
    values = case.record.clean[:, 0]
    effects = case.sensor.effects
    if "clipping" in effects:
        values = np.clip(values, effects["clipping"]["lower"], effects["clipping"]["upper"])
    if "quantization" in effects:
        step = effects["quantization"]["step"]
        values = step * np.round(values / step)
    return float(np.sqrt(np.mean(np.square(case.record.sensor[:, 0] - values))))


def corrections(case, extended):
    """NRMSE after correction by the model in use, the extended and the true one.

    All three have the bandwidth that the true model's inverse chooses. Returns the words of the
    error where one of them cannot be inverted.
    """
    from frac_accel.model import SensorModel
    from frac_accel.validation import validate

    reference, sensor, temperature = case.samples()
    wish = {}
    if temperature is not None:
        stamps, celsius = temperature
        wish["temperature_at"] = lambda at: np.interp(at, stamps, celsius)
    try:
        pair = reference, sensor
        oracle = validate(pair, SensorModel.from_dict(case.sensor.to_model()), **wish)
        wish["bandwidth_hz"] = oracle.filters["axes"]["x"]["band_hz"][1]
        judged = {"oracle": oracle, "extended": validate(pair, extended, **wish),
                  "in_use": validate(pair, case.model(), **wish)}
        return {name: v.comparison.corrected.total.nrmse for name, v in judged.items()}
    except Exception as error:  # as in `run`
        return f"{type(error).__name__}: {error}"


def _finite(value):
    return float(value) if value is not None and np.isfinite(value) else None
