"""Sweeps of a scan: a scanner's points by stretches of time with its pose and the boxes of things, as files."""
