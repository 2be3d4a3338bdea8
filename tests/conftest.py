"""Settings of all tests."""

import os
import tempfile

from hypothesis import settings

_SETTINGS = tempfile.TemporaryDirectory(prefix="gazeloc-settings-")
os.environ["XDG_CONFIG_HOME"] = _SETTINGS.name  # nobody's own settings are read or written

# A busy machine is slow at random, and the same commit must have the same result twice.
settings.register_profile("gazeloc", deadline=None, derandomize=True)
settings.load_profile("gazeloc")
