"""Units that columns of tables state, and what they are in SI units (and °C)."""

from ...errors import FracAccelError

_STANDARD_GRAVITY = 9.80665
# To m/s²; below, outputs of a sensor that is not calibrated, which stay as they are.
_ACCELERATION = {
    "m/s2": 1.0, "m/s/s": 1.0, "ms-2": 1.0, "m.s-2": 1.0, "mps2": 1.0, "mm/s2": 1e-3,
    "cm/s2": 1e-2, "gal": 1e-2, "g": _STANDARD_GRAVITY, "gn": _STANDARD_GRAVITY,
    "g0": _STANDARD_GRAVITY, "mg": 1e-3 * _STANDARD_GRAVITY, "ug": 1e-6 * _STANDARD_GRAVITY,
}
_OWN = ("v", "mv", "uv", "a", "ma", "c", "pc", "count", "counts", "lsb", "digit", "digits", "raw",
        "1", "bit", "bits")
_TIME_NS = {"s": 10**9, "sec": 10**9, "seconds": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
_CELSIUS = {"degc": 0.0, "c": 0.0, "celsius": 0.0, "k": -273.15, "kelvin": -273.15}
KNOWN = "m/s^2, g, mg; V, mV, counts and other units of a sensor's output are kept"


def _plain(unit):
    """A unit's spelling without what differs from writer to writer."""
    for old, new in (("²", "2"), ("^", ""), ("**", ""), ("*", "."), ("·", "."), ("µ", "u"),
                     ("μ", "u"), ("°", "deg"), (" ", ""), ("(", ""), (")", "")):
        unit = unit.replace(old, new)
    return unit.lower()


def acceleration_factor(unit, where):
    """Factor from a unit to m/s², or 1 where it is an output's own unit.

    Raises
    ------
    FracAccelError
        If the unit is not known; `where` says whose it is.
    """
    plain = _plain(unit)
    if plain in _OWN:
        return 1.0
    if plain not in _ACCELERATION:
        raise FracAccelError(f"{where}: unit '{unit}' is not known, expected one of {KNOWN}")
    return _ACCELERATION[plain]


def time_factor_ns(unit, where):
    """Nanoseconds in a unit of time; raises as `acceleration_factor`."""
    if _plain(unit) not in _TIME_NS:
        raise FracAccelError(f"{where}: unit '{unit}' is not known, expected s, ms, us or ns")
    return _TIME_NS[_plain(unit)]


def celsius_offset(unit, where):
    """What is added to a temperature to have °C; raises as `acceleration_factor`."""
    plain = _plain(unit)
    if plain not in _CELSIUS:
        raise FracAccelError(f"{where}: unit '{unit}' is not known, expected degC or K")
    return _CELSIUS[plain]
