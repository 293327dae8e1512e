"""What the parameter set says of roads beside the main one: their axes, crossing roads and ramps."""
