"""GazeLoc's algorithms and files: registers eye-tracking frames onto a room scan. Knows no viewer."""

# OpenCV before pycolmap, always: pycolmap's own libpng, loaded first, makes cv2 free foreign memory when it writes a
# PNG (seen with pycolmap 4.2.1 and OpenCV 5: "free(): invalid pointer").
import cv2 as _cv2  # noqa: F401

__version__ = "0.1.0"
