"""The centreline models, and what they are trained with."""
