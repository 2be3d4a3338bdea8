"""Alignments: the similarity that maps a reconstruction into the scan, with the evidence for it.

An alignment is immutable and named by its content. `align` fits one to keypoints, `judge` measures one that came from
elsewhere (ICP, a person, a file) at the same keypoints.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np

from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.alignment.evidence import Evidence, Verdict, measure
from gazeloc_core.alignment.similarity_fit import RobustOptions, is_degenerate, robust_fit
from gazeloc_core.alignment.verdicts import VerdictOptions, best_swap, is_mirrored, verdicts_on
from gazeloc_core.arrays import Bools
from gazeloc_core.errors import GeometryError, ProjectError
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.transforms import Similarity, rigid_from_wxyz, wxyz_of


class AlignmentMethod(StrEnum):
    """How an alignment came about."""

    KEYPOINTS = "keypoints"
    ICP_POINT_TO_POINT = "icp-point-to-point"
    ICP_POINT_TO_PLANE = "icp-point-to-plane"
    SHAPE = "shape"
    GIVEN = "given"


@dataclass(frozen=True, kw_only=True)
class AlignOptions:
    """How keypoints are aligned and judged."""

    tag_size_m: float | None = None
    """Known size of the tags between the detector's corners, in metres, to check the scale with; none: no check."""
    scan_tag_scale: float | None = None
    """Size of the scan's tags by that of the known one, measured without assuming it (`TagCorners.free_scale`)."""
    robust: RobustOptions = field(default_factory=RobustOptions)
    """How wrong pairs are found."""
    verdicts: VerdictOptions = field(default_factory=VerdictOptions)
    """Where good ends and bad begins."""


@dataclass(frozen=True, kw_only=True)
class Alignment:
    """`scan_from_sfm` as numbers (so that it survives JSON to the last bit), where it came from, and its evidence."""

    scale: float
    wxyz: tuple[float, float, float, float]
    translation_m: tuple[float, float, float]
    method: AlignmentMethod
    parent: str | None
    """The key of the alignment that a refinement started from."""
    evidence: Evidence

    @classmethod
    def of(
        cls, scan_from_sfm: Similarity, method: AlignmentMethod, evidence: Evidence, parent: str | None = None
    ) -> Alignment:
        """The alignment of a similarity."""
        w, x, y, z = (float(value) for value in wxyz_of(scan_from_sfm.rotation))
        tx, ty, tz = (float(value) for value in scan_from_sfm.translation)
        return cls(
            scale=scan_from_sfm.scale,
            wxyz=(w, x, y, z),
            translation_m=(tx, ty, tz),
            method=method,
            parent=parent,
            evidence=evidence,
        )

    @cached_property
    def scan_from_sfm(self) -> Similarity:
        """The similarity."""
        return Similarity.from_rigid(rigid_from_wxyz(self.wxyz, self.translation_m, "alignment"), self.scale)

    @cached_property
    def key(self) -> str:
        """The name of this content: the first 12 hexadecimal digits of its SHA-256."""
        text = json.dumps(self._content(), sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """What the evidence means, in words."""
        return self.evidence.verdicts

    def _content(self) -> dict[str, Any]:
        return {
            "scale": self.scale,
            "wxyz": list(self.wxyz),
            "translation_m": list(self.translation_m),
            "method": self.method.value,
            "parent": self.parent,
            "evidence": self.evidence.to_json(),
        }

    def to_json(self) -> dict[str, Any]:
        """A JSON object that `from_json` reads."""
        return {"key": self.key, **self._content()}

    @classmethod
    def from_json(cls, value: Any) -> Alignment:
        """The alignment of `to_json`.

        Raises:
            ProjectError: if it is garbled, or its content is not the one that its key names.
        """
        try:
            w, x, y, z = (float(number) for number in value["wxyz"])
            tx, ty, tz = (float(number) for number in value["translation_m"])
            alignment = cls(
                scale=float(value["scale"]),
                wxyz=(w, x, y, z),
                translation_m=(tx, ty, tz),
                method=AlignmentMethod(value["method"]),
                parent=value["parent"],
                evidence=Evidence.from_json(value["evidence"]),
            )
            named, key = value["key"], alignment.key
            _ = alignment.scan_from_sfm
        except (KeyError, TypeError, ValueError, GeometryError) as error:
            raise ProjectError(f"An alignment is garbled ({error}); align again.") from error
        if named != key:
            raise ProjectError(f"The alignment {named} was changed after it was made (now {key}); align again.")
        return alignment


def align(pairs: Correspondences, options: AlignOptions | None = None, *, model: SfmModel | None = None) -> Alignment:
    """The similarity that the keypoint pairs agree on. `model` adds residuals in px and the cameras' uncertainty.

    Raises:
        GeometryError: for fewer than three pairs, pairs at one place or on one line, and mirrored pairs; the sentence
            says what to do.
    """
    options = options or AlignOptions()
    fit = robust_fit(pairs, options.robust)
    if (is_mirrored(pairs) or is_mirrored(pairs.take(fit.inlier))) and best_swap(pairs) is None:
        raise GeometryError(
            "The keypoints fit a mirror image of the room far better than the room: left and right are exchanged "
            "on one side; check the pairs, or the axes of the reconstruction's file."
        )
    evidence = measure(
        fit.scan_from_sfm,
        pairs,
        fit.inlier,
        is_fitted=True,
        is_contradictory=fit.is_contradictory,
        tag_size_m=options.tag_size_m,
        scan_tag_scale=options.scan_tag_scale,
        model=model,
    )
    return Alignment.of(fit.scan_from_sfm, AlignmentMethod.KEYPOINTS, _with_verdicts(evidence, pairs, options))


def judge(
    scan_from_sfm: Similarity,
    pairs: Correspondences,
    options: AlignOptions | None = None,
    *,
    method: AlignmentMethod = AlignmentMethod.GIVEN,
    parent: str | None = None,
    model: SfmModel | None = None,
) -> Alignment:
    """The alignment with a similarity that was *not* fitted to these pairs (maybe none), measured at them."""
    options = options or AlignOptions()
    evidence = measure(
        scan_from_sfm,
        pairs,
        consensus(pairs, options.robust),
        is_fitted=False,
        is_contradictory=False,
        tag_size_m=options.tag_size_m,
        scan_tag_scale=options.scan_tag_scale,
        model=model,
    )
    return Alignment.of(scan_from_sfm, method, _with_verdicts(evidence, pairs, options), parent)


def consensus(pairs: Correspondences, options: RobustOptions | None = None) -> Bools:
    """(K,) which pairs agree with each other; all, where they do not determine an alignment themselves."""
    if is_degenerate(pairs):
        return np.ones(len(pairs), dtype=np.bool_)
    return robust_fit(pairs, options).inlier


def _with_verdicts(evidence: Evidence, pairs: Correspondences, options: AlignOptions) -> Evidence:
    return replace(evidence, verdicts=verdicts_on(evidence, pairs, options.verdicts))
