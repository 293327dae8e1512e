"""The only code that talks to Blender."""
