"""The builder of node groups, and what the groups of several things share."""
