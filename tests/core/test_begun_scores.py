"""What a run of scoring had done is read back as it was, and nothing of other inputs is."""

import numpy as np
import pytest

from gazeloc_core.evaluation.agreement import UNKNOWN, Agreement
from gazeloc_core.evaluation.picture_tiles import TABLE_WIDTH, Tiles
from gazeloc_core.stages.begun_scores import COLUMNS, BegunScores

FOUND = Agreement(0.5, 0.4, 0.03, 0.006, 0.7, 0.3, 0.01)


def tiles(count):
    table = np.random.default_rng(count).random((count, TABLE_WIDTH))
    return Tiles.of_table(table.astype(np.float32))


@pytest.fixture
def begun(tmp_path):
    begun = BegunScores(tmp_path / "begun.npz", "these", 6)
    begun.put(1, FOUND)
    begun.put(4, UNKNOWN)
    for frame, count in ((5, 3), (0, 0), (2, 7)):  # a frame that shows no scan has no tiles
        begun.put_tiles(frame, tiles(count))
    begun.save()
    return begun


def test_it_goes_on_where_it_was(tmp_path, begun):
    again = BegunScores(tmp_path / "begun.npz", "these", 6)
    assert again.is_done.tolist() == [False, True, False, False, True, False]
    for name in COLUMNS:
        np.testing.assert_array_equal(again.columns()[name], begun.columns()[name])
    assert again.columns()["shift_m"][1] == FOUND.shift_m
    assert {frame: len(found) for frame, found in again.tiles.items()} == {5: 3, 0: 0, 2: 7}
    np.testing.assert_array_equal(again.tiles[2].table(), tiles(7).table())


def test_what_was_done_of_other_inputs_is_not_used(tmp_path, begun):
    other = BegunScores(tmp_path / "begun.npz", "others", 6)
    assert not other.is_done.any()
    assert not other.tiles


def test_without_anything_done_there_is_nothing(tmp_path):
    BegunScores(tmp_path / "begun.npz", "these", 6).save()
    again = BegunScores(tmp_path / "begun.npz", "these", 6)
    assert not again.is_done.any()
    assert not again.tiles
