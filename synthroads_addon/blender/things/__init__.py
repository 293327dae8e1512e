"""The things of a road: for each its node groups, and what builds it."""
