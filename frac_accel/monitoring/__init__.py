"""Whether a sensor still is what its model says, while it runs: change, since when, what now."""
