"""The campaign with real processes; `lifeline demo` is a small campaign of this kind."""
