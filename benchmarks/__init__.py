"""Speed measurements, and the check of the diagnosis on data whose effect is withheld."""
