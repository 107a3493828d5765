"""What makes a record or a fit unfit: faults, delays, exchanged topics."""
