"""Live values of one or several robots: `lifeline watch`, `fleet` and `metrics`."""
