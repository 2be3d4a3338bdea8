"""Layers' colours come back as they were, and a file that holds none is refused with a sentence."""

import pytest

from gazeloc_core.errors import InputError
from gazeloc_core.surfaces.layer_colors import read_layer_colors, write_layer_colors

COLORS = {"Scan": (1, 2, 3), "Ground truth": (0, 255, 9)}


def test_colours_come_back(tmp_path):
    assert read_layer_colors(tmp_path) == {}
    write_layer_colors(tmp_path, COLORS)
    assert read_layer_colors(tmp_path) == COLORS


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        '{"format": "gazeloc-layer-colors", "version": 2, "colors": {}}',
        '{"format": "gazeloc-layer-colors", "version": 1}',
        '{"format": "gazeloc-layer-colors", "version": 1, "colors": []}',
        '{"format": "gazeloc-layer-colors", "version": 1, "colors": {"Scan": [1, 2]}}',
        '{"format": "gazeloc-layer-colors", "version": 1, "colors": {"Scan": [1, 2, 256]}}',
        '{"format": "gazeloc-layer-colors", "version": 1, "colors": {"Scan": [1, 2, true]}}',
        '{"format": "gazeloc-layer-colors", "version": 1, "colors": {"Scan": "red"}}',
    ],
)
def test_a_file_without_colours_is_refused_by_its_name(tmp_path, text):
    (tmp_path / "colors.json").write_text(text)
    with pytest.raises(InputError, match=r"colors\.json"):
        read_layer_colors(tmp_path)
