"""Fields of the scenario as Blender properties, and how they are drawn."""
