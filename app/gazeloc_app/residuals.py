"""Residuals of clicked pairs under the alignment in force, for the table and the markers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gazeloc_app.data import ProjectData
from gazeloc_app.state import AppState
from gazeloc_core.correspondences import gather
from gazeloc_core.evidence import reprojection_px
from gazeloc_core.keypoints import KeypointSet


@dataclass(frozen=True)
class PairResidual:
    """How far the two sides of a pair are apart: in metres, and in pixels of frames near it (None: none sees it)."""

    distance_m: float
    pixels: float | None


def pair_residuals(data: ProjectData, state: AppState) -> dict[str, PairResidual]:
    """The residuals by key of all complete pairs, enabled or not; none without an alignment."""
    alignment = data.alignment(state.recording, state.annotation.alignment)
    model = data.model(state.recording)
    complete = [pair for pair in state.annotation.keypoints if pair.is_complete]
    if alignment is None or not complete:
        return {}
    keypoints = KeypointSet(tuple(complete))
    for pair in complete:
        keypoints = keypoints.change(pair.key, enabled=True)
    pairs = gather(None, None, keypoints)
    distances = np.linalg.norm(alignment.scan_from_sfm.apply(pairs.sfm) - pairs.scan, axis=1)
    pixels = np.full(len(pairs), np.nan) if model is None else reprojection_px(alignment.scan_from_sfm, pairs, model)
    return {
        pair.key: PairResidual(float(distance), float(px) if np.isfinite(px) else None)
        for pair, distance, px in zip(complete, distances, pixels, strict=True)
    }
