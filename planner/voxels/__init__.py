"""Voxel columns of a mesh, and what is too thin in them."""
