"""Pictures as JPEG, there and back."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import cv2
import numpy as np

from gazeloc_core.arrays import Bytes
from gazeloc_core.errors import RenderError

JPEG_QUALITY = 90


def jpeg_of(rgb: Bytes) -> bytes:
    """A picture (H, W, 3) as JPEG."""
    done, data = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not done:
        raise RenderError(f"A picture of {rgb.shape[1]}x{rgb.shape[0]} pixels cannot be written as JPEG.")
    return bytes(data)


def when_picture(use: Callable[[Bytes], None]) -> Callable[[Future[Any]], None]:
    """A callback for a future of JPEG bytes that passes the picture (H, W, 3) on, on whichever thread it came.

    One that was superseded or failed is dropped.
    """

    def done(future: Future[Any]) -> None:
        if future.exception() is None:
            bgr = cv2.imdecode(np.frombuffer(future.result(), np.uint8), cv2.IMREAD_COLOR)
            use(np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8))

    return done
