"""How good a segmentation is: scores, tables and pictures."""
