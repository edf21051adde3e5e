"""Cut a part into shells that fit triangle for triangle."""
