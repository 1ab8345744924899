"""The operator's requests: keys and their meaning, and pilots that convert keys to a velocity.

Pure, except for the configuration.
"""
