"""What the alignment in force leaves of each clicked pair, and what each pair does to it: for the table and markers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gazeloc_app.data import ProjectData
from gazeloc_app.state import AppState
from gazeloc_core.alignment.alignment import Alignment
from gazeloc_core.alignment.correspondences import Correspondences, gather
from gazeloc_core.alignment.evidence import reprojection_px
from gazeloc_core.alignment.pair_effects import PairEffects, pair_effects
from gazeloc_core.arrays import Floats
from gazeloc_core.keypoints import KeypointSet
from gazeloc_core.sfm_model import SfmModel


@dataclass(frozen=True)
class PairResidual:
    """How far the two sides of a pair are apart: in metres, and in pixels of frames near it (None: none sees it).

    `left_out_m` and `cameras_move_m` are what leaving the pair out does (see `PairEffects`); None where the alignment
    in force is not fitted to keypoints, or the others determine none. `is_used`: it agrees with the others.
    """

    distance_m: float
    pixels: float | None
    left_out_m: float | None = None
    cameras_move_m: float | None = None
    is_used: bool = True


def pair_residuals(data: ProjectData, state: AppState) -> dict[str, PairResidual]:
    """The residuals by key of all complete pairs, enabled or not; none without an alignment."""
    alignment = data.alignment(state.recording, state.annotation.alignment)
    model = data.model(state.recording)
    complete = [pair for pair in state.annotation.keypoints if pair.is_complete]
    if alignment is None or not complete:
        return {}
    pairs = gather(None, None, KeypointSet(tuple(replace(pair, enabled=True) for pair in complete)))
    distances = np.linalg.norm(alignment.scan_from_sfm.apply(pairs.sfm) - pairs.scan, axis=1)
    pixels = np.full(len(pairs), np.nan) if model is None else reprojection_px(alignment.scan_from_sfm, pairs, model)
    counting = gather(data.scan_tags(), data.sfm_tags(state.recording), state.annotation.keypoints)
    effects = _effects(alignment, counting, model)
    row = {group: index for index, group in enumerate(counting.group_names)} if effects else {}
    wrong = {point.group for point in alignment.evidence.keypoints if not point.is_inlier}
    return {
        pair.key: PairResidual(
            float(distance),
            _or_none(px),
            _or_none(effects.left_out_m[row[pair.key]]) if effects and pair.key in row else None,
            _or_none(effects.cameras_move_m[row[pair.key]]) if effects and pair.key in row else None,
            is_used=pair.key not in wrong,
        )
        for pair, distance, px in zip(complete, distances, pixels, strict=True)
    }


def _effects(alignment: Alignment, pairs: Correspondences, model: SfmModel | None) -> PairEffects | None:
    if not alignment.evidence.is_fitted or len(pairs) == 0:
        return None
    wrong = {point.group for point in alignment.evidence.keypoints if not point.is_inlier}
    inlier = np.array([group not in wrong for group in pairs.groups])
    return pair_effects(alignment.scan_from_sfm, pairs, inlier, model)


def _or_none(value: Floats | float) -> float | None:
    return float(value) if np.isfinite(value) else None
