"""Keypoints: pairs of a place on the scan and the same place in the reconstruction. Tags give them, people click them.

The frame `sfm` is the reconstruction's own, of arbitrary scale. A pair counts for alignment when both sides are there
and it is enabled. A side may come from sightings in frames (a click in two or more), by triangulation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.errors import InputError

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Sighting:
    """A click in a frame: pixel (x, y), first pixel centre at 0.5.

    Of the recording it is the *undistorted* frame, by its index; of the scan one of `frames_with_images`, as stored.
    """

    frame_index: int
    x_px: float
    y_px: float


def add_sighting(sightings: tuple[Sighting, ...], sighting: Sighting) -> tuple[Sighting, ...]:
    """The sightings with one more; an earlier one in the same frame gives way."""
    return (*(s for s in sightings if s.frame_index != sighting.frame_index), sighting)


@dataclass(frozen=True)
class KeypointPair:
    """One clicked keypoint: `scan` in metres on the scan, `sfm` in the reconstruction's units, either may be missing.

    `sightings` are the clicks in the recording's frames from which `sfm` was triangulated; empty where it was clicked
    in the cloud. `sfm_sigma` is then the standard deviation of `sfm`, in the reconstruction's units: far points are
    known worse. `scan_sightings` and `scan_sigma` (in metres) are the same of `scan`, from the phone's frames.
    """

    key: str
    name: str
    scan: Point | None = None
    sfm: Point | None = None
    sightings: tuple[Sighting, ...] = ()
    sfm_sigma: float | None = None
    enabled: bool = True
    scan_sightings: tuple[Sighting, ...] = ()
    scan_sigma: float | None = None

    @property
    def is_complete(self) -> bool:
        """Whether both sides are there."""
        return self.scan is not None and self.sfm is not None

    @property
    def counts(self) -> bool:
        """Whether the pair takes part in an alignment."""
        return self.is_complete and self.enabled


@dataclass(frozen=True)
class KeypointSet:
    """The clicked keypoints of one recording, in the order of their making. Methods return a changed set."""

    pairs: tuple[KeypointPair, ...] = ()

    def __iter__(self) -> Iterator[KeypointPair]:
        return iter(self.pairs)

    def __len__(self) -> int:
        return len(self.pairs)

    def get(self, key: str) -> KeypointPair | None:
        """The pair with this key, None if there is none."""
        return next((pair for pair in self.pairs if pair.key == key), None)

    def add(self, pair: KeypointPair) -> KeypointSet:
        """With one more pair, at the end."""
        return KeypointSet((*self.pairs, pair))

    def change(self, key: str, **fields: Any) -> KeypointSet:
        """With the fields of one pair replaced; unchanged where the key is unknown."""
        return KeypointSet(tuple(replace(pair, **fields) if pair.key == key else pair for pair in self.pairs))

    def remove(self, key: str) -> KeypointSet:
        """Without one pair."""
        return KeypointSet(tuple(pair for pair in self.pairs if pair.key != key))

    def next_key(self) -> str:
        """A key that no pair has: k1, k2, ..."""
        numbers = [int(pair.key[1:]) for pair in self.pairs if pair.key[1:].isdigit()]
        return f"k{max(numbers, default=0) + 1}"

    def counting(self) -> tuple[list[str], Floats, Floats]:
        """Names, scan points (K, 3) and sfm points (K, 3) of the pairs that count."""
        pairs = [pair for pair in self.pairs if pair.counts]
        scan = np.array([pair.scan for pair in pairs], dtype=np.float64).reshape(-1, 3)
        sfm = np.array([pair.sfm for pair in pairs], dtype=np.float64).reshape(-1, 3)
        return [pair.name for pair in pairs], scan, sfm

    def to_json(self) -> list[dict[str, Any]]:
        """A JSON array that `from_json` reads."""
        return [asdict(pair) for pair in self.pairs]

    @classmethod
    def from_json(cls, values: Any) -> KeypointSet:
        """The set of `to_json`.

        Raises:
            InputError: if a field is missing or garbled.
        """
        try:
            return cls(tuple(_pair_from_json(value) for value in values))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"The keypoints are garbled ({error}); restore the file from a backup.") from error


def _pair_from_json(value: dict[str, Any]) -> KeypointPair:
    return KeypointPair(
        key=str(value["key"]),
        name=str(value["name"]),
        scan=_point_from_json(value["scan"]),
        sfm=_point_from_json(value["sfm"]),
        sightings=_sightings_from_json(value["sightings"]),
        sfm_sigma=_number_from_json(value.get("sfm_sigma")),
        enabled=bool(value["enabled"]),
        scan_sightings=_sightings_from_json(value.get("scan_sightings", ())),  # files of earlier versions have none
        scan_sigma=_number_from_json(value.get("scan_sigma")),
    )


def _sightings_from_json(values: Any) -> tuple[Sighting, ...]:
    return tuple(Sighting(int(s["frame_index"]), float(s["x_px"]), float(s["y_px"])) for s in values)


def _number_from_json(value: Any) -> float | None:
    return None if value is None else float(value)


def _point_from_json(value: Any) -> Point | None:
    if value is None:
        return None
    x, y, z = (float(v) for v in value)
    if not np.isfinite([x, y, z]).all():
        raise ValueError(f"a point is not finite: {value}")
    return x, y, z
