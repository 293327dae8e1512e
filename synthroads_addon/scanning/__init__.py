"""The scanner: pulses, returns, radiometry, noise, weather."""
