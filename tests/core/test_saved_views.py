"""Places to look from: the usual ones have the room in view, saved ones come back, and nonsense is refused."""

import numpy as np
import pytest

from gazeloc_core.errors import InputError
from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.saved_views import SavedView, read_views, usual_views, write_views
from gazeloc_core.surfaces.viewpoint import FOV_RAD, up_vector

CORNERS = np.array([[x, y, z] for x in (0, 6) for y in (0, 4) for z in (0, 2.5)], float)
ROOM = Mesh(np.repeat(CORNERS, 50, axis=0), np.array([[0, 51, 101]]))


@pytest.mark.parametrize("up_axis", ["x", "y", "z", "-y"])
def test_every_usual_view_has_the_whole_room_in_it_and_looks_its_way(up_axis):
    views, up = usual_views(ROOM, up_axis), up_vector(up_axis)
    assert list(views) == ["Start", "Top", "Front", "Side"]
    for view in views.values():
        eye = np.array(view.eye)
        forward = np.subtract(view.target, eye) / np.linalg.norm(np.subtract(view.target, eye))
        to_corner = CORNERS - eye
        depth = to_corner @ forward
        across = np.linalg.norm(to_corner - depth[:, None] * forward, axis=1)
        if view.name != "Start":
            assert (depth > 0).all()
            assert (across / depth).max() < np.tan(FOV_RAD / 2)
    level = [abs(float(np.subtract(views[name].target, views[name].eye) @ up)) for name in ("Front", "Side")]
    assert max(level) < 1e-9
    assert np.subtract(views["Top"].eye, views["Top"].target) @ up > 1


def test_views_come_back_as_they_were_saved(tmp_path):
    assert read_views(tmp_path) == ()
    views = (SavedView.of("desk <b>", [1, 2, 3], np.zeros(3), 0.8), SavedView("door", (0, 0, 1), (0, 0, 0)))
    write_views(tmp_path, views)
    assert read_views(tmp_path) == views


@pytest.mark.parametrize(
    "numbers",
    [
        ([0, 0, 0], [0, 0, 0], 1.0),
        ([np.nan, 0, 0], [0, 0, 0], 1.0),
        ([1e9, 0, 0], [0, 0, 0], 1.0),
        ([1, 0, 0], [0, 0, 0], 4.0),
    ],
    ids=["looks at itself", "not a number", "beyond the earth", "too wide"],
)
def test_what_is_no_place_to_look_from_is_refused(numbers):
    with pytest.raises(InputError, match="no place to look from"):
        SavedView.of("a", *numbers)


@pytest.mark.parametrize("name", ["", "x" * 61])
def test_a_name_has_a_length(name):
    with pytest.raises(InputError, match="1 to 60 characters"):
        SavedView(name, (1, 0, 0), (0, 0, 0))


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"format": "gazeloc-views", "version": 1, "views": [{}]}', '{"format": 1}']
)
def test_a_damaged_file_is_named(tmp_path, text):
    (tmp_path / "views.json").write_text(text)
    with pytest.raises(InputError, match=r"views\.json"):
        read_views(tmp_path)
