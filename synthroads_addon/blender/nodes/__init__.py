"""The node groups: one module each, and the small builder that they share."""
