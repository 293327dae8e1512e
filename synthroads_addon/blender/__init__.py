"""Work done in Blender: model, scenes, casters, cameras, views. Beside `ui` the only part that uses its modules."""
