"""Which tags a room needs: maps for the project's own lens, tag size and scan; tags are tried out once and kept."""

import dataclasses

import numpy as np
import pytest
from app_project import LENS, SIZE_M, make_app_project

from gazeloc_core.charts.chart_file import read_charts
from gazeloc_core.errors import InputError
from gazeloc_core.stages.advice import TITLES, draw_advice, floor_size_m
from gazeloc_core.stages.inputs import load_scan
from gazeloc_core.tag_quality import remembered as memory
from gazeloc_core.tag_quality.safe_range import SafeRangeOptions, tag_quality, try_tags

GRID = SafeRangeOptions(pixels=(30, 100), angles_deg=(0, 45), repeats=2)


@pytest.fixture
def project(tmp_path):
    return make_app_project(tmp_path / "room")


def test_the_maps_are_of_this_lens_tag_and_room(project, tmp_path):
    charts = draw_advice(project, "walk", tmp_path / "cache", GRID)
    assert set(charts) == set(TITLES.values())
    kept, notes = read_charts(project.artifact("walk", "advice"))
    assert set(kept) == set(charts)
    assert notes == ()
    detection, sizes = charts[TITLES["detection"]], charts[TITLES["sizes"]]
    assert detection.y.tolist() == [30, 100]
    own = dataclasses.replace(GRID, focal_px=300)  # of the lens, rounded
    assert np.array_equal(detection.values, tag_quality(try_tags(own)).detection_rate)
    assert round(float(LENS.focal_px.mean())) in (300, 301)
    assert np.isnan(sizes.values[-1, 0])  # 8 cm from 5 m: 5 px with this lens
    assert "4.0 x 3.0 m" in charts[TITLES["rooms"]].title


def test_the_floor_is_as_large_as_the_room(project):
    width, length = floor_size_m(load_scan(project))
    assert [width, length] == pytest.approx(SIZE_M[:2].tolist(), abs=0.02)


def test_what_was_tried_out_is_kept_and_made_anew_where_it_is_damaged(tmp_path, monkeypatch):
    first = memory.remembered_quality(tmp_path, GRID)
    tries = []
    monkeypatch.setattr(memory, "try_tags", lambda *given: tries.append(given) or try_tags(*given))
    again = memory.remembered_quality(tmp_path, GRID)
    assert tries == []
    assert np.array_equal(first.rotation_error_deg, again.rotation_error_deg, equal_nan=True)
    memory.remembered_quality(tmp_path, dataclasses.replace(GRID, repeats=1))
    assert len(tries) == 1
    for file in tmp_path.rglob("arrays.npz"):
        file.write_bytes(b"garbage")
    anew = memory.remembered_quality(tmp_path, GRID)
    assert len(tries) == 2
    assert np.array_equal(first.detection_rate, anew.detection_rate)


def test_without_a_tag_size_it_says_what_is_missing(project, tmp_path):
    settings = project.settings
    project.save(dataclasses.replace(settings, tags=dataclasses.replace(settings.tags, size_m=None)))
    with pytest.raises(InputError, match=r"the maps need the tags' size; make the project with --tag-size"):
        draw_advice(project, "walk", tmp_path, GRID)
