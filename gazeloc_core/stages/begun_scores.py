"""What a run of scoring has done so far, kept beside its artifact: one that was cancelled or killed goes on there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, fields
from functools import partial
from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Floats, Ints
from gazeloc_core.evaluation.agreement import Agreement
from gazeloc_core.evaluation.picture_tiles import TABLE_WIDTH, Tiles
from gazeloc_core.storage.begun_file import Arrays, BegunFile

COLUMNS = tuple(field.name for field in fields(Agreement))
_KEEP_EVERY_S = 5.0


class BegunScores:
    """The frames that are scored, and the tiles of those that are compared with each other first.

    `key` names what they depend on: what is kept of other inputs, or is damaged, is not used.
    """

    def __init__(self, path: Path, key: str, count: int):
        self._file = BegunFile(path, key, _KEEP_EVERY_S)
        self._table = np.full((count, len(COLUMNS)), np.nan)
        self.is_done = np.zeros(count, np.bool_)
        self.tiles: dict[int, Tiles] = {}
        kept = self._file.read(partial(_kept, count))
        if kept is not None:
            done, scores, self.tiles = kept
            self._table[done], self.is_done[done] = scores, True

    def put(self, index: int, found: Agreement) -> None:
        """Keep a frame's score."""
        self._table[index], self.is_done[index] = astuple(found), True
        self._save_sometimes()

    def put_tiles(self, index: int, tiles: Tiles) -> None:
        """Keep a frame's tiles."""
        self.tiles[index] = tiles
        self._save_sometimes()

    def columns(self) -> Mapping[str, Floats]:
        """The scores (N,) by the names of `Agreement`, NaN where there is none."""
        return {name: self._table[:, column] for column, name in enumerate(COLUMNS)}

    def save(self) -> None:
        """Write what there is."""
        done, tables = np.flatnonzero(self.is_done), [tiles.table() for tiles in self.tiles.values()]
        self._file.write(
            {
                "done": done,
                "scores": self._table[done],
                "tiles_of": np.array(list(self.tiles), dtype=np.int64),
                "tile_counts": np.array([len(table) for table in tables], dtype=np.int64),
                "tiles": np.concatenate([np.zeros((0, TABLE_WIDTH), np.float32), *tables]),
            }
        )

    def forget(self) -> None:
        """All is done: remove the file."""
        self._file.forget()

    def _save_sometimes(self) -> None:
        if self._file.is_due:
            self.save()


def _kept(count: int, arrays: Arrays) -> tuple[Ints, Floats, dict[int, Tiles]]:
    done, scores = arrays["done"], arrays["scores"]
    np.zeros((count, len(COLUMNS)))[done] = scores  # an error where they do not fit
    tables = np.split(arrays["tiles"], np.cumsum(arrays["tile_counts"])[:-1])
    return done, scores, dict(zip(arrays["tiles_of"].tolist(), map(Tiles.of_table, tables), strict=False))
