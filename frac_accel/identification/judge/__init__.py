"""What a fit is worth: residual, held-out data, other structures, other records."""
