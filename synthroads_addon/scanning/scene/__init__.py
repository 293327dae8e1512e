"""Scenes that rays can meet: triangles, and what moves."""
