"""Reading and writing clouds: LAS and LAZ, PLY, E57, NPZ."""
