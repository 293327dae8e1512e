"""Functions and data that need no Blender: plain Python and NumPy."""
