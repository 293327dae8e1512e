"""Points of a class: by a cloud's labels, or by where they lie beside a road's axis."""
