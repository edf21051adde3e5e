"""Why printed parts differ from what the palette predicts."""
