"""Points and their files: container, classes, LAS, previews."""
