"""The blind suite: how often `frac_accel.diagnose` is right about what the rig has hidden.

`plan` says which cases there are, `trial` runs one, `score` counts, `report` writes it down.
Run it by ``make blind``. `tell` writes a single case down, for a look at it by hand.
"""
