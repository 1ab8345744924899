"""Incidents: find and read the black boxes of stops, summarize them, draw them, and run the law over them again."""
