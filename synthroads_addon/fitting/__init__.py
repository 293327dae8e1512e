"""A measured axis as an alignment of lines, arcs and clothoids."""
