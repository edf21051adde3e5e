"""How a target between two catalogue materials is met: dithered cells, bands in turn, mixtures."""
