"""Roads of one carriageway with traffic both ways: the lines between the directions, and their standard sections."""
