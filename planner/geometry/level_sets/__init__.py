"""Division of a part along curved level sets: marching tetrahedra met exactly with the surface."""
