"""Shield gantries."""
