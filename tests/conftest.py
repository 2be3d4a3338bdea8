"""Settings of all tests."""

import os
import tempfile

from hypothesis import settings

os.environ["XDG_CONFIG_HOME"] = tempfile.mkdtemp(prefix="gazeloc-settings-")  # nobody's own settings: read nor written

# A busy machine is slow at random, and the same commit must have the same result twice.
settings.register_profile("gazeloc", deadline=None, derandomize=True)
settings.load_profile("gazeloc")
