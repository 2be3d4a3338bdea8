"""The size of a picture of the user's, and the camera that belongs to a picture of that size."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError


def size_of(picture: Path) -> tuple[int, int]:
    """Width and height as stored, from the file's head; EXIF orientation is not applied.

    Raises:
        InputError: if it does not decode.
    """
    try:
        with Image.open(picture) as image:
            return image.size
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise InputError.of(picture, "the picture does not decode", "export it again or remove it") from error


def camera_at_size(camera: Camera, size: tuple[int, int], picture: Path) -> Camera:
    """The camera of a picture that may have been resized, but not cropped, since the intrinsics were written.

    Raises:
        InputError: if the picture has another shape than the camera.
    """
    if abs(size[0] * camera.height - size[1] * camera.width) > 0.01 * size[0] * camera.height:
        problem = f"the picture is {size[0]}x{size[1]}, of another shape than its intrinsics' "
        problem += f"{camera.width}x{camera.height}"
        raise InputError.of(picture, problem, "export again, without cropping or turning pictures")
    return camera.scaled(*size)
