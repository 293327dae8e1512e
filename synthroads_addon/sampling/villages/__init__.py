"""Sampling of what villages bring onto a road: things and markings, islands at their ends, service trenches."""
