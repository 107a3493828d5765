"""Verbs of the command ``frac_accel``: thin shells over the package."""
