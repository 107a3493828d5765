"""Damaged bags, models and metadata for every command, each case by its number.

``python -m fuzz`` (``make fuzz``) goes on until it is stopped; the suite runs a fixed share of it.
"""
