"""The ways to localise a frame. All stay available and are measured alike; none ever stands in for another."""

from __future__ import annotations

from enum import StrEnum

from gazeloc_core.errors import InputError


class Method(StrEnum):
    """How the frames of a recording get their poses in the scan; `…-paper` are the paper's recipes, kept faithful."""

    SFM = "sfm"
    SFM_PAPER = "sfm-paper"
    TAGS = "tags"
    TAGS_PAPER = "tags-paper"
    GLOBAL = "global"

    @property
    def summary(self) -> str:
        """What it does, in a few words for people."""
        return _SUMMARIES[self]

    @property
    def needs_tags(self) -> bool:
        """Whether it cannot do without tags in the room (`sfm` takes clicked keypoints too)."""
        return self in (Method.SFM_PAPER, Method.TAGS, Method.TAGS_PAPER)

    @property
    def has_model(self) -> bool:
        """Whether its poses come from a reconstruction, which can be exported with them."""
        return self not in (Method.TAGS, Method.TAGS_PAPER)


_SUMMARIES = {
    Method.SFM: "reconstruction, aligned by tags and keypoints",
    Method.SFM_PAPER: "reconstruction, aligned as in the paper",
    Method.TAGS: "tags alone, all sightings joined",
    Method.TAGS_PAPER: "tags alone, chained as in the paper",
    Method.GLOBAL: "reconstruction, aligned by shape alone",
}


def method_named(name: str) -> Method:
    """The method of a name that a user gave.

    Raises:
        InputError: if there is none of this name.
    """
    try:
        return Method(name)
    except ValueError:
        raise InputError(f"There is no method {name!r}; the methods are: {', '.join(Method)}.") from None
