"""Settings of all tests."""

from hypothesis import settings

# A busy machine is slow at random, and the same commit must have the same result twice.
settings.register_profile("gazeloc", deadline=None, derandomize=True)
settings.load_profile("gazeloc")
