"""Model structures, and their fits in time and in frequency."""
