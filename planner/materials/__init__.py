"""Materials: laws, mixtures, tests and fits."""
