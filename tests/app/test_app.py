"""The app without a browser: actions in, then the state, the widgets and the files; and what must not harm them."""

from __future__ import annotations

import asyncio
import errno
from types import SimpleNamespace

import numpy as np
import pytest
from app_project import SFM_FROM_SCAN, make_app_project, true_poses
from app_steps import step, stop, wait_for_job
from gazeloc_app.actions.choices import ChooseAlignment
from gazeloc_app.actions.history import Redo, Undo
from gazeloc_app.actions.jobs import JobEnded, StartJob
from gazeloc_app.actions.pairs import SelectPair
from gazeloc_app.actions.picks import PickPoint, PickSighting, Side
from gazeloc_app.actions.views import ShowFrame, ShowLayer
from gazeloc_app.app import App
from gazeloc_app.frames.sightings import frame_pose, triangulated
from gazeloc_app.state import Layer, Level
from gazeloc_app.work import tasks
from viser import _messages

from gazeloc_core.errors import ProjectLockedError
from gazeloc_core.keypoints import Sighting
from gazeloc_core.stages import registration

ON_SCAN = [(1.0, 0.02, 1.5), (0.02, 0.9, 1.6), (3.0, 0.02, 1.1), (0.9, 0.3, 0.76), (2.9, 1.9, 0.47)]


def widgets(app, label):
    """The widgets with this label."""
    handles = app.server.gui._gui_input_handle_from_uuid.values()
    return [handle for handle in handles if getattr(handle, "label", None) == label]


def send(app, handle, value):
    """What a browser's message does, callbacks included."""
    gui = app.server.gui
    gui._resolve_client = lambda client_id: SimpleNamespace(client_id=client_id)
    asyncio.run(gui._handle_gui_updates(7, _messages.GuiUpdateMessage(handle._impl.uuid, {"value": value})))


def clicks():
    """Five pairs, clicked exactly, as actions."""
    for point in ON_SCAN:
        yield PickPoint(Side.SCAN, point)
        x, y, z = SFM_FROM_SCAN.apply(np.array(point)).tolist()
        yield PickPoint(Side.SFM, (x, y, z))


def test_a_click_is_on_the_disk_after_the_step_and_undo_and_redo_are_too(app, project):
    step(app, PickPoint(Side.SCAN, (1, 2, 0.5)))
    assert [pair.scan for pair in project.keypoints("walk")] == [(1, 2, 0.5)]
    step(app, Undo())
    assert len(project.keypoints("walk")) == 0
    step(app, Redo())
    assert project.keypoints("walk") == app.store.state.annotation.keypoints
    assert len(project.keypoints("walk")) == 1


def test_the_table_and_the_markers_show_the_pairs(app):
    step(app, *clicks())
    (name,) = widgets(app, "Name")
    assert name.value == "Keypoint 5"
    nodes = app.server.scene._handle_from_node_name
    assert "/keypoints/k3/scan" in nodes
    assert "/keypoints/k3/sfm" in nodes
    step(app, Undo(), Undo())
    assert "/keypoints/k5/scan" not in nodes
    assert "/keypoints/k4/scan" in nodes


@pytest.mark.slow
def test_aligning_refining_and_exporting_in_the_jobs_process(app, project, tmp_path):
    step(app, *clicks(), StartJob("Align", tasks.align, (("recording", "walk"),)))
    (button,) = widgets(app, "Align")
    assert button.disabled
    wait_for_job(app)
    assert not button.disabled
    state = app.store.state
    assert state.notice.level is Level.INFO, state.notice
    chosen = project.settings.chosen["walk"]
    assert chosen.by_person
    assert chosen.alignment == state.annotation.alignment
    trajectory = app.data.trajectory("walk", chosen.alignment)
    centres = np.array(true_poses().translation)[trajectory.is_registered]
    assert np.linalg.norm(trajectory.centers[trajectory.is_registered] - centres, axis=1).max() < 0.005
    assert "/frusta/estimate" in app.server.scene._handle_from_node_name

    step(app, StartJob("Refine", tasks.refine, (("recording", "walk"), ("start", chosen.alignment))))
    wait_for_job(app)
    assert "ICP" in app.store.state.notice.text or "Refined" in app.store.state.notice.text
    assert app.data.refinement("walk")["start"] == chosen.alignment

    keywords = (("recording", "walk"), ("formats", ("csv", "tum")), ("output", str(tmp_path / "out")))
    step(app, StartJob("Export", tasks.export, keywords))
    wait_for_job(app)
    assert app.store.state.notice.level is Level.INFO, app.store.state.notice
    assert {"poses.csv", "gaze3d.csv", "poses.tum"} <= {path.name for path in (tmp_path / "out").rglob("*.*")}

    step(app, Undo())
    assert project.settings.chosen.get("walk") is None or app.store.state.annotation.alignment is not None


@pytest.mark.slow
def test_a_run_does_not_replace_what_a_person_chose(app, project):
    step(app, StartJob("Align", tasks.align, (("recording", "walk"),)))
    wait_for_job(app)
    first = app.store.state.annotation.alignment
    step(app, *clicks())
    app.run_everything()
    wait_for_job(app)
    assert app.store.state.notice.level is Level.INFO, app.store.state.notice
    assert registration.fitted_alignment(project, "walk") != first
    assert app.store.state.annotation.alignment == first
    assert (project.settings.chosen["walk"].alignment, project.settings.chosen["walk"].by_person) == (first, True)


def test_the_outcome_of_a_run_gives_way_to_a_choice_made_meanwhile(app):
    step(app, StartJob("Run everything", _never), ChooseAlignment("aa"), JobEnded(Level.INFO, "done", "bb", False))
    assert app.store.state.annotation.alignment == "aa"


def _never(folder, report, **keywords):
    raise AssertionError("ended before it began")


def test_a_job_that_follows_another_in_one_step_is_begun(app, monkeypatch):
    begun = []
    monkeypatch.setattr(app.jobs, "start", lambda name, task, **keywords: begun.append(name))
    step(app, StartJob("first", _never))
    step(app, JobEnded(Level.INFO, "done"), StartJob("second", _never))
    assert begun == ["first", "second"]


def test_aligning_without_keypoints_is_a_sentence_and_the_app_lives_on(tmp_path):
    project = make_app_project(tmp_path, tags=False)
    app = App(project, port=0)
    step(app, StartJob("Align", tasks.align, (("recording", "walk"),)))
    wait_for_job(app)
    assert app.store.state.notice.level is Level.ERROR
    assert "click" in app.store.state.notice.text
    step(app, PickPoint(Side.SCAN, (1, 1, 0)))
    assert len(project.keypoints("walk")) == 1
    stop(app)


class TestTwoRecordings:
    @pytest.fixture
    def project(self, tmp_path):
        return make_app_project(tmp_path, recordings=("walk", "sit"))

    def test_each_keeps_its_own_annotation(self, app, project):
        step(app, PickPoint(Side.SCAN, (1, 1, 0)))
        app._open_recording("sit")
        step(app)
        assert app.store.state.recording == "sit"
        assert len(app.store.state.annotation.keypoints) == 0
        step(app, PickPoint(Side.SCAN, (2, 1, 0)))
        app._open_recording("walk")
        step(app)
        assert [pair.scan for pair in app.store.state.annotation.keypoints] == [(1, 1, 0)]
        assert [pair.scan for pair in project.keypoints("sit")] == [(2, 1, 0)]

    def test_a_click_just_before_another_is_opened_is_saved_with_its_own(self, app, project):
        app.store.dispatch(PickPoint(Side.SCAN, (1, 1, 0)))
        app._open_recording("sit")
        app.store.dispatch(PickPoint(Side.SCAN, (2, 1, 0)))
        app.store.step()
        assert [pair.scan for pair in project.keypoints("walk")] == [(1, 1, 0)]
        assert [pair.scan for pair in project.keypoints("sit")] == [(2, 1, 0)]


def test_a_full_disk_is_said_and_the_click_is_saved_once_there_is_room(app, project, monkeypatch):
    from gazeloc_core import project as project_module

    def full(path, value):
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    with monkeypatch.context() as patched:
        patched.setattr(project_module, "write_json_atomically", full)
        step(app, PickPoint(Side.SCAN, (1, 2, 0)))
        assert app.store.state.notice.level is Level.ERROR
        assert "No space left" in app.store.state.notice.text
        step(app, StartJob("Align", _never))
        step(app)
        assert app.store.state.job is None  # it would have read the keypoints of before
        assert not app.jobs._busy.locked()
    assert len(project.keypoints("walk")) == 0
    step(app, ShowFrame(3))
    assert len(project.keypoints("walk")) == 1


def test_damaged_artifacts_do_not_take_the_app_along(app, project):
    for stage in ("reconstruction", "anchoring", "corners"):
        (project.artifact("walk", stage).folder / "arrays.npz").write_bytes(b"not arrays")
    (project.artifact("walk", "keyframes").folder / "header.json").write_text("{")
    step(app, JobEnded(Level.INFO, "something ran"))
    step(app, PickPoint(Side.SCAN, (1, 2, 0)))
    assert len(project.keypoints("walk")) == 1
    assert "/keypoints/k1/scan" in app.server.scene._handle_from_node_name


def test_a_damaged_project_opens_with_what_is_whole(project):
    (project.artifact("walk", "anchoring").folder / "arrays.npz").write_bytes(b"not arrays")
    app = App(project, port=0)
    app.store._render()
    app.store.step()
    assert "/scan" in app.server.scene._handle_from_node_name
    assert "damaged" in (app.store.state.notice.text if app.store.state.notice else "")
    stop(app)


def test_a_damaged_frame_is_a_sentence_for_its_url_and_the_next_one_is_shown(app):
    path = app.data.recording("walk").path / "f_003.png"
    path.write_bytes(path.read_bytes()[:300])
    routes = app._routes()
    missing = asyncio.run(routes.answer("/frames/walk/3.jpg?rev=1"))
    assert missing.status in (404, 503)
    assert b"f_003.png" in missing.body
    assert asyncio.run(routes.answer("/frames/walk/4.jpg?rev=1")).status == 200


@pytest.mark.parametrize("rev", ["", "..%2f..%2fproject", "zz", "0123456789ab"])
def test_a_render_needs_an_alignment_that_there_is(app, rev):
    assert asyncio.run(app._routes().answer(f"/renders/walk/2.jpg?rev={rev}")).status == 404


@pytest.mark.parametrize(
    ("label", "value"),
    [
        ("Every n-th", 10**9),
        ("Every n-th", -1),
        ("Every n-th", float("nan")),
        ("Every n-th", "3"),
        ("Recording", "../../etc/passwd"),
        ("In force", "made up"),
        ("Selected", "k99 · x"),
        ("Name", "renamed although disabled"),
        ("Counts", "yes"),
        ("Colour", [1, 2]),
        ("Delete the pair", True),
        ("Folder", "x" * 5000),
    ],
)
def test_a_value_that_a_widget_does_not_offer_changes_nothing(app, label, value):
    (handle,) = widgets(app, label)
    before, shown = app.store.state, handle.value
    send(app, handle, value)
    step(app)
    assert app.store.state == before
    assert handle.value == shown


def test_a_value_that_a_widget_offers_is_an_action(app):
    (slider,) = widgets(app, "Every n-th")
    send(app, slider, 5)
    step(app)
    assert app.store.state.layers.thinning == 5
    (box,) = widgets(app, Layer.SCAN.value)
    send(app, box, False)
    step(app)
    assert not app.store.state.layers.is_visible(Layer.SCAN)


def test_a_second_app_on_the_project_is_refused_with_a_sentence(app, project):
    with pytest.raises(ProjectLockedError, match="another"):
        App(project, port=0)
    step(app, PickPoint(Side.SCAN, (1, 2, 0)))
    assert len(project.keypoints("walk")) == 1


def test_the_lock_is_free_again_when_the_port_is_taken(app, tmp_path):
    other = make_app_project(tmp_path / "other")
    with pytest.raises(Exception, match="Port"):
        App(other, port=app.server.get_port())
    other.lock().release()


def test_only_frames_in_the_reconstruction_can_be_looked_through(app):
    state = app.store.state
    assert frame_pose(app.data, state, 4) is not None
    assert frame_pose(app.data, state, 5) is None
    (button,) = widgets(app, "Look through this camera")
    step(app, ShowFrame(5))
    assert button.disabled
    step(app, ShowFrame(6))
    assert not button.disabled


def test_clicks_on_one_spot_in_several_frames_give_its_place(app):
    camera, place = app.data.camera("walk"), np.array(ON_SCAN[3])
    sightings = []
    for frame in (0, 6, 12):
        x, y = camera.project(true_poses()[frame].inv().apply(place)[None])[0]
        sightings.append(Sighting(frame, float(x), float(y)))
    found, sigma = triangulated(app.data, "walk", tuple(sightings))
    np.testing.assert_allclose(SFM_FROM_SCAN.inverse().apply(np.array(found)), place, atol=1e-4)
    assert sigma > 0
    assert isinstance(triangulated(app.data, "walk", tuple(sightings[:1])), str)
    step(app, PickSighting(sightings[0]), PickSighting(sightings[1], "k1", found, sigma))
    assert app.store.state.annotation.keypoints.pairs[0].sfm == found


def test_layers_hide_and_labels_of_hidden_layers_too(app):
    step(app, *clicks())
    node = app.server.scene._handle_from_node_name["/keypoints/k1/scan"]
    assert node.visible
    step(app, ShowLayer(Layer.KEYPOINTS, False), SelectPair(None), PickPoint(Side.SCAN, (1, 1, 0)))
    assert not app.server.scene._handle_from_node_name["/keypoints/k1/scan"].visible
    assert not app.server.scene._handle_from_node_name["/keypoints/k6/scan"].visible
