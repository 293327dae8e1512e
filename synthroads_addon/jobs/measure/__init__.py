"""Measuring speed and errors: the trade-off and the benchmark."""
