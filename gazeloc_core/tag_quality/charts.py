"""The maps of section IX: what a tag is worth by its size in the picture and its angle, and what a room needs."""

from __future__ import annotations

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.charts.values import HeatMap
from gazeloc_core.tag_quality.advice import RoomOptions, room_map, size_map
from gazeloc_core.tag_quality.safe_range import TagQuality

DISTANCES_M: Floats = np.array([0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0])
SIZES_M: Floats = np.array([0.08, 0.10, 0.12, 0.16, 0.20, 0.24])


def quality_maps(quality: TagQuality, tag_size_m: float) -> dict[str, HeatMap]:
    """Detection rate, errors of the pose, and how often it is the wrong one of two, by pixels per tag and angle."""

    def over_grid(title: str, unit: str, values: Floats) -> HeatMap:
        return HeatMap(title, "viewing angle [°]", "pixels per tag", unit, quality.angle_deg, quality.pixels, values)

    size_cm = 100 * tag_size_m
    return {
        "detection": over_grid("Detection rate", "share", quality.detection_rate),
        "position": over_grid(
            f"Position error of a {size_cm:.0f} cm tag", "cm", size_cm * quality.position_error_sizes
        ),
        "rotation": over_grid("Rotation error", "°", quality.rotation_error_deg),
        "flipped": over_grid("Wrong one of the two poses", "share", quality.flipped_share),
    }


def advice_maps(quality: TagQuality, options: RoomOptions) -> dict[str, HeatMap]:
    """Which tag sizes are safe from how far, and how many of which size a room needs."""
    sizes, rooms = size_map(quality, options.focal_px, DISTANCES_M, SIZES_M), room_map(quality, options)
    return {
        "sizes": HeatMap(
            "Widest safe angle, by tag size and distance",
            "tag size [m]",
            "distance [m]",
            "°",
            sizes.size_m,
            sizes.distance_m,
            sizes.widest_deg,
        ),
        "rooms": HeatMap(
            f"Views with a safe tag in a room of {options.width_m:.1f} x {options.length_m:.1f} m",
            "tag size [m]",
            "tags in the room",
            "share",
            rooms.size_m,
            rooms.count.astype(np.float64),
            rooms.share_safe,
        ),
    }
