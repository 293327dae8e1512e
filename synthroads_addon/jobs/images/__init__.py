"""Images of cameras as files: pictures and truth, and what other programs read of their poses and lenses."""
