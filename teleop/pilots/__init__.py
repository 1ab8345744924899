"""What the operator wants: keys and their meaning, and pilots that convert keys to a velocity. Pure, but for the configuration."""
