"""Ground floor: tetrahedra, materials, elasticity. Usable alone; imports nothing else of ours."""
