"""`lifeline demo`: a few trials of the real campaign and a drive at a rack, each judged by one promise."""
