"""The jobs: they join scenario, Blender and scanner."""
