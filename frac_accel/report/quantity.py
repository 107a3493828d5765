"""Values with standard uncertainties as text."""

import math

from ..model.parameters import parameter_fields


def rounded(value, std):
    """Value and standard uncertainty, both to the second significant digit of the latter.

    As the *Guide to the Expression of Uncertainty in Measurement* (JCGM 100:2008, 7.2.6) has it.

    Parameters
    ----------
    value : float or str
        A word stands as it is.
    std : float

    Returns
    -------
    tuple of str
        The uncertainty is empty where there is none (zero or not finite).

    Examples
    --------
    >>> rounded(180.0032658, 0.00941)
    ('180.0033', '0.0094')
    >>> rounded(1234567.0, 4321.0)
    ('1234600', '4300')
    """
    if isinstance(value, str):
        return value, ""
    if not (math.isfinite(std) and std > 0 and math.isfinite(value)):
        return f"{value:.6g}", ""
    digits = 1 - math.floor(math.log10(std))
    # 0.0996 is 0.10 to two digits, not 0.100
    digits = 1 - math.floor(math.log10(round(std, digits)))
    if digits > 6 and abs(value) < 1e-3:
        exponent = math.floor(math.log10(max(abs(value), std)))
        scale, places = 10.0**-exponent, digits + exponent
        return (f"{value * scale:.{places}f}e{exponent:+03d}",
                f"{std * scale:.{places}f}e{exponent:+03d}")
    places = max(digits, 0)
    return f"{round(value, digits):.{places}f}", f"{round(std, digits):.{places}f}"


def percent(share):
    """A share in percent, to two digits, without an exponent.

    Examples
    --------
    >>> percent(0.000213), percent(1.094)
    ('0.021 %', '109 %')
    """
    return f"{100 * share:.0f} %" if share >= 1 else f"{100 * share:.2g} %"


def left_open_by(parameters, core):
    """Names of parameters that can only be above zero and are less than their uncertainty.

    Their figures would say nothing.

    Parameters
    ----------
    parameters : dict of str to dict
        ``value`` and ``std`` by name.
    core : object
        Core of the model that they belong to.
    """
    positive = {field.name for field in parameter_fields(type(core))
                if field.metadata.get("above") == 0}
    return {name for name, entry in parameters.items()
            if name in positive and entry["std"] > abs(entry["value"])}
