"""Synthetic clouds beside real ones: which statistics differ, and how surely the two can be told apart."""
