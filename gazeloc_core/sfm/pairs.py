"""Which pairs of frames are worth matching: near in time, or alike to look at.

Frames are compared by VLAD (Jégou et al., "Aggregating local descriptors into a compact image representation", CVPR
2010): a small vocabulary is learnt from the recording's own SIFT descriptors, each frame is the sum of its descriptors'
offsets from their words. This costs about a second and finds the places that the person came back to.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any, Protocol, TypeAlias

import cv2
import numpy as np

from gazeloc_core.arrays import Floats

Pairs: TypeAlias = set[tuple[int, int]]
"""Pairs (a, b) of positions with a < b."""

_WORDS = 32
_SAMPLES = 20_000
_DESCRIPTORS_PER_FRAME = 1500


class PairOptions(Protocol):
    """What of `SfmOptions` the choice of pairs needs."""

    @property
    def sequential_neighbours(self) -> int: ...  # noqa: D102
    @property
    def similar_neighbours(self) -> int: ...  # noqa: D102
    @property
    def exhaustive_up_to(self) -> int: ...  # noqa: D102


def choose_pairs(descriptors: Sequence[Any], seed: int, options: PairOptions) -> Pairs:
    """The pairs to match among frames in order of time, given each frame's SIFT descriptors (n, 128)."""
    count = len(descriptors)
    if count <= options.exhaustive_up_to:
        return set(combinations(range(count), 2))
    near = pairs_near_in_time(count, options.sequential_neighbours)
    return near | pairs_alike(frame_signatures(descriptors, seed), options.similar_neighbours, near)


def pairs_near_in_time(count: int, neighbours: int) -> Pairs:
    """Each frame with its `neighbours` followers, and with those at the powers of two beyond."""
    steps = set(range(1, neighbours + 1)) | {2**k for k in range(1, 30) if neighbours < 2**k < count}
    return {(a, a + step) for step in steps for a in range(count - step)}


def pairs_alike(signatures: Floats, neighbours: int, known: Pairs) -> Pairs:
    """For each frame the `neighbours` with the most similar signatures (N, D) that are not in `known` yet."""
    similarity = signatures @ signatures.T
    np.fill_diagonal(similarity, -np.inf)
    for a, b in known:
        similarity[a, b] = similarity[b, a] = -np.inf
    found: Pairs = set()
    for a, row in enumerate(similarity):
        best = np.argsort(-row, kind="stable")[:neighbours]
        found |= {(min(a, int(b)), max(a, int(b))) for b in best if np.isfinite(row[b])}
    return found


def frame_signatures(descriptors: Sequence[Any], seed: int) -> Floats:
    """VLAD signatures of unit length (N, words * 128); zero for a frame without descriptors."""
    rng = np.random.default_rng(seed)
    sets = [np.sqrt(np.asarray(d, dtype=np.float32).reshape(-1, 128)[:_DESCRIPTORS_PER_FRAME]) for d in descriptors]
    everything = np.concatenate(sets)
    if len(everything) < 4 * _WORDS:
        return np.zeros((len(sets), _WORDS * 128))
    sample = everything[rng.permutation(len(everything))[:_SAMPLES]]
    cv2.setRNGSeed(seed)
    criteria = (cv2.TERM_CRITERIA_MAX_ITER, 12, 0.0)
    _, _, words = cv2.kmeans(sample, _WORDS, None, criteria, 1, cv2.KMEANS_PP_CENTERS)
    return np.array([_vlad(d, np.asarray(words)) for d in sets])


def _vlad(descriptors: Any, words: Any) -> Floats:
    signature = np.zeros(words.shape)
    if len(descriptors):
        nearest = (descriptors @ words.T - (words**2).sum(axis=1) / 2).argmax(axis=1)
        np.add.at(signature, nearest, descriptors - words[nearest])
    signature /= np.maximum(np.linalg.norm(signature, axis=1, keepdims=True), 1e-9)  # each word counts the same
    flat = signature.ravel()
    return np.asarray(flat / max(float(np.linalg.norm(flat)), 1e-9))
