"""Data sets of many scenes: recipes, manifests, the layouts that training code reads, and data cards."""
