"""Values with standard uncertainties as text."""

import math
from typing import NamedTuple

from ..model.parameters import parameter_fields
from .panels import COVERAGE_FACTOR

# What numbers of these units are given a prefix for, so that nobody counts zeros.
_PREFIXED = ("s", "Hz")
_PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


class Scaled(NamedTuple):
    """What to multiply numbers with, and the unit that they have then; empty where it is one."""

    factor: float
    unit: str


def scaled(value, unit, least=1.0):
    """Unit with the SI prefix with which a value is between `least` and a thousand times that.

    Examples
    --------
    >>> scaled(0.00129994, "s").unit, scaled(180.0, "Hz").unit, scaled(1e-4, "1/K").unit
    ('ms', 'Hz', '1/K')
    """
    shown = "" if unit == "1" else unit.replace("^2", "²")
    if unit not in _PREFIXED or isinstance(value, str) or not math.isfinite(value) or not value:
        return Scaled(1.0, shown)
    # a value such as 999.9999999 is not far enough below a thousand to be told from it
    power = 3 * math.floor(round(math.log10(abs(value) / least), 9) / 3)
    power = min(max(power, min(_PREFIXES)), max(_PREFIXES))
    return Scaled(10.0**-power, _PREFIXES[power] + shown)


def short(value, unit):
    """A value to four digits, with the prefix that suits it.

    Examples
    --------
    >>> short(0.0006001, "s"), short(0.018, "s"), short(0.0, "s")
    ('600.1 µs', '18 ms', '0 s')
    """
    factor, shown = scaled(value, unit)
    return f"{factor * value:.4g} {shown}"


def fixed(value):
    """A value to three places, without the sign of a zero; a dash where none is known.

    Examples
    --------
    >>> fixed(-0.0002), fixed(-1.5), fixed(float("nan"))
    ('0.000', '-1.500', '-')
    """
    return "-" if math.isnan(value) else f"{round(value, 3) + 0.0:.3f}"


def written(value, std, unit):
    """A value with its standard uncertainty and unit, both with the prefixes that suit them.

    Parameters
    ----------
    value : float or str
    std : float
    unit : str
        SI.

    Returns
    -------
    str

    Examples
    --------
    >>> written(0.00129994123, 1.1e-7, "s")
    '1.29994 ms ± 0.11 µs'
    >>> written(180.00328, 0.0094, "Hz"), written(0.149952, 4.8e-5, "1")
    ('180.0033 Hz ± 9.4 mHz', '0.149952 ± 0.000048')
    >>> written(0.00024998, 5.8e-8, "1/m^2")
    '(2.49980 ± 0.00058)e-04 1/m²'
    """
    if isinstance(value, str):
        return f"{value} {scaled(value, unit).unit}".rstrip()
    large = scaled(value if abs(value) > std or not std > 0 else std, unit)
    shown, spread = rounded(value * large.factor, std * large.factor)
    small = large
    if spread and unit in _PREFIXED:
        # two digits, neither of them a zero that only fills up
        small = scaled(std, unit, 0.1)
        spread = rounded(std * small.factor, std * small.factor)[1]
    if not spread:
        return f"{shown} {large.unit}".rstrip()
    if small == large:
        number, mark, exponent = shown.partition("e")
        both = f"{number} ± {spread.partition('e')[0]}"
        return f"{f'({both})e{exponent}' if mark else both} {large.unit}".rstrip()
    return f"{shown} {large.unit} ± {spread} {small.unit}"


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


def cells(value, std, unit):
    """Cells of a table for an estimate: value, standard uncertainty, 95 % interval (k = 2), unit.

    Examples
    --------
    >>> cells(0.00129994, 1.1e-7, "s")
    ['1.29994', '0.00011', '1.29972 to 1.30016', 'ms']
    >>> cells("bessel", 0.0, "1")
    ['bessel', '–', '–', '1']
    """
    factor, shown_unit = scaled(value, unit)
    value, std = value if isinstance(value, str) else factor * value, factor * std
    shown, uncertainty = rounded(value, std)
    if not uncertainty:
        return [shown, "–", "–", shown_unit or "1"]
    low, high = (rounded(value + sign * COVERAGE_FACTOR * std, std)[0] for sign in (-1, 1))
    return [shown, uncertainty, f"{low} to {high}", shown_unit or "1"]


def percent(share):
    """A share in percent, to two digits, without an exponent; ``unknown`` where it is.

    Examples
    --------
    >>> percent(0.000213), percent(1.094)
    ('0.021 %', '109 %')
    """
    if math.isnan(share):
        return "unknown"
    return f"{100 * share:.0f} %" if share >= 1 else f"{100 * share:.2g} %"


def held_out_words(nrmse):
    """What is left of held-out data (RMS, of the output), or that there are none.

    Examples
    --------
    >>> held_out_words(0.01234), held_out_words(float("nan"))
    ('1.234% on held-out data', 'too short to hold data out')
    """
    return f"{nrmse:.3%} on held-out data" if math.isfinite(nrmse) else "too short to hold data out"


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
