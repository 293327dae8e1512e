"""Work that shares Blender's main thread: done in turns, or called for by other threads."""
