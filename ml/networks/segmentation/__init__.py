"""Networks that give every point a class, and what they need to know of a cloud's geometry."""
