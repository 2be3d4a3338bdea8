"""The recording's cameras in the scene: how many, in which colours, and against the truth."""

import json
import struct
from types import SimpleNamespace

import numpy as np
import pytest
from app_project import make_app_project, true_poses
from app_steps import step, stop
from gazeloc_app.actions.choices import ChooseMethod, CompareMethod
from gazeloc_app.actions.views import ColorCameras, ShowLayer, ThinCameras, UseSafeColors
from gazeloc_app.app import App
from gazeloc_app.palette import SAFE, STATUSES, USUAL
from gazeloc_app.panels.camera_colors import legend
from gazeloc_app.scene.frusta import EDGES
from gazeloc_app.state import AppState, Coloring, Layer
from gazeloc_app.user_settings import UserSettings, settings_path

from gazeloc_core.errors import GazelocError
from gazeloc_core.methods import Method
from gazeloc_core.stages import inputs
from gazeloc_core.surfaces.glb import linear_from_srgb
from gazeloc_core.trajectory import PoseStatus, Trajectory


@pytest.fixture
def app(tmp_path):
    """The method `tags` has poses of all frames: true ones, but for 3 cm on every second."""
    project = make_app_project(tmp_path)
    recording = inputs.load_recording(project, "walk")
    poses = true_poses()
    centers = np.array(poses.translation)
    centers[::2, 0] += 0.03
    status = np.where(np.arange(len(centers)) % 3, PoseStatus.REGISTERED.value, PoseStatus.TAG_ONLY.value)
    trajectory = Trajectory(
        recording.timestamp_ns, status, np.ones(len(centers), bool), centers, poses.rotation.as_quat(scalar_first=True)
    )
    project.result("walk", Method.TAGS, "trajectory").write_arrays(
        inputs.trajectory_arrays(trajectory), options={}, inputs={}
    )
    app = App(project, port=0)
    step(app, ChooseMethod(Method.TAGS))
    yield app
    stop(app)


def lines_of(app, name):
    """How many lines a node has, and the colours (V, 3) of its points in linear light."""
    data = app.server.scene._handle_from_node_name[name].glb_data
    length = struct.unpack_from("<I", data, 12)[0]
    document, binary = json.loads(data[20 : 20 + length]), data[28 + length :]
    primitive = document["meshes"][0]["primitives"][0]
    count = lambda row: document["accessors"][row]["count"]  # noqa: E731
    color = document["accessors"][primitive["attributes"]["COLOR_0"]]
    start = document["bufferViews"][color["bufferView"]]["byteOffset"]
    values = np.frombuffer(binary, np.uint16, 4 * color["count"], start).reshape(-1, 4)[:, :3] / 65535
    number = count(primitive["indices"]) if "indices" in primitive else color["count"]
    return number // 2, values


def test_every_nth_camera_is_drawn_and_the_path_through_all(app):
    frames = len(app.data.recording("walk"))
    assert lines_of(app, "/frusta/estimate")[0] == frames * len(EDGES) + frames - 1
    step(app, ThinCameras(4))
    assert lines_of(app, "/frusta/estimate")[0] == -(-frames // 4) * len(EDGES) + frames - 1
    assert lines_of(app, "/frusta/truth")[0] == -(-len(app.data.true_keyframes("walk")) // 4) * len(EDGES)
    step(app, ThinCameras(None))
    assert lines_of(app, "/frusta/estimate")[0] == frames * len(EDGES) + frames - 1


def test_more_cameras_than_leave_the_room_to_be_seen_are_thinned_by_themselves(app, monkeypatch):
    monkeypatch.setattr("gazeloc_app.scene.cameras.MANY", 10)
    frames = len(app.data.recording("walk"))
    assert app.scene.cameras.thinning(app.store.state) == -(-frames // 10)


def test_a_step_out_of_range_is_brought_into_it(app):
    step(app, ThinCameras(-7))
    assert app.store.state.layers.thinning == 1
    step(app, ThinCameras(10**9))
    assert app.store.state.layers.thinning == 100


def test_colours_stand_for_the_method_the_error_or_the_status(app):
    close = lambda a, b: np.abs(a - b).max() < 1e-4  # noqa: E731
    assert close(lines_of(app, "/frusta/estimate")[1], linear_from_srgb(USUAL.estimate))
    step(app, ColorCameras(Coloring.ERROR))
    scale = app.scene.cameras.scale(app.store.state)
    assert scale.high == pytest.approx(0.05)
    expected = linear_from_srgb(scale.colors([0.03, 0.0]))
    colors = lines_of(app, "/frusta/estimate")[1]
    assert close(colors[:6], expected[0])
    assert close(colors[6:12], expected[1])
    step(app, ColorCameras(Coloring.STATUS))
    colors = lines_of(app, "/frusta/estimate")[1]
    assert close(colors[:6], linear_from_srgb(STATUSES[PoseStatus.TAG_ONLY]))
    assert close(colors[6:12], linear_from_srgb(STATUSES[PoseStatus.REGISTERED]))


def test_the_switch_gives_all_sets_the_colours_for_colour_blind_eyes_and_is_kept_for_every_project(app):
    close = lambda a, b: np.abs(a - b).max() < 1e-4  # noqa: E731
    before = len(app.store.state.past)
    step(app, UseSafeColors(True))
    assert close(lines_of(app, "/frusta/estimate")[1], linear_from_srgb(SAFE.estimate))
    assert close(lines_of(app, "/frusta/truth")[1], linear_from_srgb(SAFE.truth))
    handles = app.server.gui._gui_input_handle_from_uuid.values()
    labels = {handle.label: handle for handle in handles if hasattr(handle, "label")}
    assert "orange" in labels["Estimate"].hint
    assert "blue" in labels["Ground truth"].hint
    assert labels["Colours for colour-blind eyes"].value is True
    assert len(app.store.state.past) == before
    assert UserSettings().put_into(AppState(("a",), "a")).cameras is SAFE
    step(app, ChooseMethod(Method.SFM), CompareMethod(Method.TAGS, True))
    assert close(lines_of(app, "/frusta/methods/tags")[1], linear_from_srgb(SAFE.methods[Method.TAGS]))
    step(app, UseSafeColors(False), ChooseMethod(Method.TAGS))
    assert close(lines_of(app, "/frusta/estimate")[1], linear_from_srgb(USUAL.estimate))
    assert UserSettings().put_into(AppState(("a",), "a")).cameras is USUAL


@pytest.mark.parametrize("text", ["{", "[]", '{"safe_colors": "yes"}', '{"other": 1}'])
def test_settings_that_cannot_be_read_leave_everything_as_usual(text, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    settings_path().parent.mkdir()
    settings_path().write_text(text)
    told = []
    assert UserSettings(told.append).put_into(AppState(("a",), "a")).cameras is USUAL
    assert bool(told) == (text in ("{", "[]"))


def test_settings_that_cannot_be_written_are_said(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "file"))
    usual = AppState(("a",), "a")
    with pytest.raises(GazelocError, match="could not be kept"):
        UserSettings().save(usual, UseSafeColors(True).apply(usual))


def test_lines_go_from_the_estimates_to_the_truth(app):
    nodes = app.server.scene._handle_from_node_name
    assert "/errors" not in nodes
    step(app, ShowLayer(Layer.ERRORS, True))
    frames = len(app.data.recording("walk"))
    assert lines_of(app, "/errors")[0] == frames
    step(app, ShowLayer(Layer.ERRORS, False))
    assert "/errors" not in nodes or not nodes["/errors"].visible


def test_a_method_that_is_compared_is_drawn_again_after_it_was_the_chosen_one(app):
    step(app, ChooseMethod(Method.SFM), CompareMethod(Method.TAGS, True))
    nodes = app.server.scene._handle_from_node_name
    assert "/frusta/methods/tags" in nodes
    step(app, ChooseMethod(Method.TAGS))
    assert "/frusta/methods/tags" not in nodes
    step(app, ChooseMethod(Method.SFM))
    assert "/frusta/methods/tags" in nodes


def test_the_legend_says_what_colours_mean(app):
    assert legend(Coloring.SET, None) == ""
    assert "tag only" in legend(Coloring.STATUS, None)
    assert "ground truth" in legend(Coloring.ERROR, None)
    step(app, ColorCameras(Coloring.ERROR))
    assert "5 cm and more" in legend(Coloring.ERROR, app.scene.cameras.scale(app.store.state))


def test_colours_stand_for_the_agreement_where_it_is_known(app, monkeypatch):
    step(app, ColorCameras(Coloring.SCORE))
    assert app.scene.cameras.scale(app.store.state) is None
    assert "no scores yet" in legend(Coloring.SCORE, None)
    scores = np.linspace(0.2, 0.9, len(app.data.recording("walk")))
    monkeypatch.setattr(app.data, "frame_scores", lambda *_: SimpleNamespace(score=scores))
    app.store._render()
    scale = app.scene.cameras.scale(app.store.state)
    colors = lines_of(app, "/frusta/estimate")[1]
    assert np.abs(colors[:6] - linear_from_srgb(scale.colors([0.2])[0])).max() < 1e-4
    assert "0.21 and less" in legend(Coloring.SCORE, scale)
