"""Kernels: loops of the scan that are compiled (C, by tools/build_kernels.py), each beside the Python that calls it.

Where one is missing, or a machine has none, the scan goes the way that needs none: see `packets`.
"""
