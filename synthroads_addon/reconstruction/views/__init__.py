"""Independent views of where a road's axis lies, each from one kind of evidence, and their fusion."""
