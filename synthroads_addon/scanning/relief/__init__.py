"""Relief that points have and the mesh has not: roughness of materials, and the pavement's heights."""
