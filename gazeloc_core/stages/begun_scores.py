"""What a run of scoring has done so far, kept beside its artifact: one that was cancelled or killed goes on there."""

from __future__ import annotations

import io
import time
from collections.abc import Mapping
from dataclasses import astuple, fields
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.evaluation.agreement import Agreement
from gazeloc_core.evaluation.picture_tiles import TABLE_WIDTH, Tiles
from gazeloc_core.storage.files import write_bytes_atomically

COLUMNS = tuple(field.name for field in fields(Agreement))
_KEEP_EVERY_S = 5.0


class BegunScores:
    """The frames that are scored, and the tiles of those that are compared with each other first.

    `key` names what they depend on: what is kept of other inputs, or is damaged, is not used.
    """

    def __init__(self, path: Path, key: str, count: int):
        self._path, self._key = path, key
        self._saved_at = time.monotonic()
        self._table = np.full((count, len(COLUMNS)), np.nan)
        self.is_done = np.zeros(count, np.bool_)
        self.tiles: dict[int, Tiles] = {}
        if path.is_file():
            self._load()

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
        content = io.BytesIO()
        np.savez(
            content,
            of=np.array(self._key),
            done=done,
            scores=self._table[done],
            tiles_of=np.array(list(self.tiles), dtype=np.int64),
            tile_counts=np.array([len(table) for table in tables], dtype=np.int64),
            tiles=np.concatenate([np.zeros((0, TABLE_WIDTH), np.float32), *tables]),
        )
        write_bytes_atomically(self._path, content.getvalue())
        self._saved_at = time.monotonic()

    def forget(self) -> None:
        """All is done: remove the file."""
        self._path.unlink(missing_ok=True)

    def _save_sometimes(self) -> None:
        if time.monotonic() - self._saved_at > _KEEP_EVERY_S:
            self.save()

    def _load(self) -> None:
        try:
            with np.load(self._path, allow_pickle=False) as file:
                if str(file["of"]) != self._key:
                    return
                done, scores = file["done"], file["scores"]
                tables = np.split(file["tiles"], np.cumsum(file["tile_counts"])[:-1])
                tiles = dict(zip(file["tiles_of"].tolist(), map(Tiles.of_table, tables), strict=False))
            self._table[done], self.is_done[done], self.tiles = scores, True, tiles
        except (OSError, ValueError, KeyError, IndexError, EOFError, BadZipFile):
            self.is_done[:] = False  # damaged: all is done anew
