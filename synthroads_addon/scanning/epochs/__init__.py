"""What a scan knows of another epoch of its road: what has changed at each point, how far, and what was seen before."""
