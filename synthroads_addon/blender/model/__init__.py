"""The road model in Blender: built from parameters, kept with the file, read back after edits."""
