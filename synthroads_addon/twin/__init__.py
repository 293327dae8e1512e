"""Geometric-semantic models of a road in open formats."""
