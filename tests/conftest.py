"""For every test."""

from hypothesis import settings

# A deadline for each example would test the machine: pytest-timeout ends what hangs.
settings.register_profile("lifeline", deadline=None)
settings.load_profile("lifeline")
