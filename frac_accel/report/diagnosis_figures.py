"""What the simulation gets wrong, by the model in use and by the extended one, in figures."""

import numpy as np

from ..diagnosis.evidence import MOST_POINTS
from . import figures
from .signals import over_time


def discrepancy(section, found):
    """Fill a section with the figures."""
    seen = found.evidence
    over_time(section, seen,
              lambda view: figures.time_signals(view["output"], view["residual"]), MOST_POINTS,
              "Sensor's output, measured and simulated from the reference, and the residuals "
              "(measured less simulated)")
    _in_frequency(section, seen, found.baseline["noise_rms"])
    section.figure(
        figures.lines(seen.by_size["x"], seen.by_size["rms"], "output's distance from its "
                      "mean [output units]", "residual's RMS [output units]", log="y"),
        "Residual by the size of the output. What grows along this line hints at a spring that is "
        "not linear, a limit, or a gain; noise is level.")
    section.figure(
        figures.lines(seen.by_time["x"], seen.by_time["rms"], "time [s]",
                      "residual's RMS [output units]", log="y"),
        "Residual by time. What changes along this line hints at a drift, at temperature, at a "
        "clock, or at a change of the excitation.")


def _in_frequency(section, seen, noise_rms):
    density = seen.density
    residuals = {f"residual, {name}": values for name, values in density["residual"].items()}
    section.figure(
        figures.spectra(density["frequency_hz"], {"measured output": density["output"],
                                                  **residuals},
                        level=noise_rms * np.sqrt(2 / seen.sampling_rate_hz),
                        colours=(figures.MEASURED, *figures.SERIES)),
        "Amplitude spectral densities of the output and of the residuals, and of white noise as "
        f"strong as what may be noise: {noise_rms:.3g} output units (RMS).")
