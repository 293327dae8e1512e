"""Arithmetic that compiled loops may do in place of NumPy: the functions, and which way they go."""
