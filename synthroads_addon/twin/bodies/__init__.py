"""Bodies of furniture and structures in true dimensions."""
