"""Files: read and written whole, in one canonical form."""
