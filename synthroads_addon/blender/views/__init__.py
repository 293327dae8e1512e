"""Views: clouds over the 3D views, pictures of scenes, the gallery."""
