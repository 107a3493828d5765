"""What an identified structure would have made of the reference."""

from ...model import SensorModel
from ...model.effects import identified_effect
from ...simulation import AxisSimulator


def predicted(structure, fit, reference, sampling_rate_hz, lag_s):
    """Simulated output at the sensor's samples, which are `lag_s` later than the reference's.

    Parameters
    ----------
    structure : OscillatorStructure, FractionalStructure or ArxStructure
    fit : Fit
    reference : ndarray, shape (n,)
    sampling_rate_hz, lag_s : float

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    FracAccelError
        If no model can have these parameters.
    """
    # the pair's lag belongs to the stamps, not to the sensor
    model = SensorModel(structure.core(fit), [identified_effect("delay_s", fit["delay_s"] - lag_s),
                                              identified_effect("offset", fit["offset"])])
    return AxisSimulator(reference, sampling_rate_hz).simulate(model.axes[0])
