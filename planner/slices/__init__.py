"""A plan as the printer's own layers: voxels of one material each, as images."""
