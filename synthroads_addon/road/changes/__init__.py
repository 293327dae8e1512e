"""Changes of a road between two epochs: as data, made to a parameter set, and found between two sets."""
