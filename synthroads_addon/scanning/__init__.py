"""What a scanner does: pulses, returns, radiometry, noise, weather."""
