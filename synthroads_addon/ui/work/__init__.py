"""Long work of the panel, and its buttons."""
