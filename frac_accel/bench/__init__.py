"""Figures of speed and memory, each beside the peer that it is compared with."""
