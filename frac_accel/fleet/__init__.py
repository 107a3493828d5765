"""Many bags through one verb: which bags there are, where rows go, who does the work, what a fleet
knows that one bag does not."""
