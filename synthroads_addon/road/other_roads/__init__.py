"""Parts of the parameter set for roads beside the main one: their axes, crossing roads and ramps."""
