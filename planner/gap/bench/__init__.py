"""Score diagnoses of campaigns whose cause is known.

Scoring takes the JSON documents of contract 5, so that the answers of any program can be scored,
and knows nothing of how the campaigns were made.
"""
