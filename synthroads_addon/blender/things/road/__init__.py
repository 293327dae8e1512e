"""The road itself: strips, markings and their heights."""
