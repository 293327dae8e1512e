"""Foundations that every other part stands on: errors, schemas, files, classes, random streams."""
