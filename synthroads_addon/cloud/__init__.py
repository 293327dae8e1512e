"""Points, their layers and their files."""
