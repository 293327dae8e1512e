"""What rays can meet: triangles, and what moves."""
