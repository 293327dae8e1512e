"""Weather: what it does to the beam. One file each."""
