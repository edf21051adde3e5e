"""Which effect causes a gap: evidence of every hypothesis."""
