"""Where tests find real recordings, which are not part of the project."""

from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[1]
SHARED = CHECKOUT.parent / "shared" / "data"
SAMPLE_SCENES = CHECKOUT / "sample_scenes"

needs_shared = pytest.mark.skipif(not SHARED.is_dir(), reason=f"the real recordings are not at {SHARED}")
