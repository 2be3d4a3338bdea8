"""The command `gazeloc advise`: which tags to print for a room."""

from __future__ import annotations

from gazeloc_app.terminal import progress_bar, table
from gazeloc_core.storage.user_cache import user_cache
from gazeloc_core.tag_quality.advice import RoomOptions, room_map
from gazeloc_core.tag_quality.remembered import remembered_quality
from gazeloc_core.tag_quality.safe_range import SafeRangeOptions


def advise(*, width_m: float, length_m: float, focal_px: float, view_deg: float, quick: bool) -> None:
    """Print the share of views that see a safe tag, by number and size of the tags."""
    room = RoomOptions(width_m=width_m, length_m=length_m, focal_px=focal_px, view_deg=view_deg)
    options = SafeRangeOptions(focal_px=focal_px) if not quick else SafeRangeOptions(focal_px=focal_px, repeats=3)
    with progress_bar() as report:
        quality = remembered_quality(user_cache(), options, report)
    found = room_map(quality, room)
    rows = [
        [str(n), *(f"{share:.0%}" for share in shares)] for n, shares in zip(found.count, found.share_safe, strict=True)
    ]
    print(table(["tags", *(f"{100 * size:.0f} cm" for size in found.size_m)], rows))
    print("Share of a wearer's views that show at least one tag from which alone a pose is good to 8 cm and 2°.")
    print("An empty room with tags along its walls; the methods sfm and tags join many views and need less.")
