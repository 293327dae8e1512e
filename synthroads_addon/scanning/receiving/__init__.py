"""From the light that comes back to what a scanner writes: detection, echoes, range noise, response, radiometry."""
