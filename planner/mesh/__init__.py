"""Triangle meshes: joined, audited, repaired, placed."""
