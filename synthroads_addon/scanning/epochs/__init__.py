"""A scan's knowledge of another epoch of its road: what has changed at each point, how far, what was seen before."""
