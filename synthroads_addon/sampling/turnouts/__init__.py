"""Exits, entries and emergency bays at stations: where there is room for one, and one more on a road that is there."""
