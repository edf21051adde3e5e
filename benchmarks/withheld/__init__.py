"""The check of the diagnosis on campaigns whose cause is known, but not to the diagnoser."""
