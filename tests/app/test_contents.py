"""The tab Layers offers what there is, and what is new as soon as it is there."""

from app_project import make_app_project
from app_steps import step, stop
from gazeloc_app.actions.choices import ChooseAlignment
from gazeloc_app.app import App
from gazeloc_app.data import ProjectData
from gazeloc_app.panels.contents import layers_with_contents
from gazeloc_app.panels.layers import LayerPanel
from gazeloc_app.state import AppState, Layer

from gazeloc_core.stages.registration import align_keypoints

OF_POSES = {Layer.ESTIMATE, Layer.GAZE, Layer.ERRORS}


def test_poses_bring_their_layers(tmp_path):
    app = App(make_app_project(tmp_path), port=0)
    try:
        app.store._render()
        boxes = app.panels.of(LayerPanel)._boxes
        assert {layer for layer in Layer if not boxes[layer].visible} == OF_POSES | {Layer.PHONE}
        step(app, ChooseAlignment(align_keypoints(app.project, "walk").key))
        assert {layer for layer in Layer if not boxes[layer].visible} == {Layer.PHONE}
        assert Layer.ESTIMATE.value in app.panels.of(LayerPanel)._which.options
    finally:
        stop(app)


def test_without_tags_none_of_theirs_is_offered(tmp_path):
    found = layers_with_contents(ProjectData(make_app_project(tmp_path, tags=False)), AppState(("walk",), "walk"))
    assert not {Layer.SCAN_TAGS, Layer.SFM_TAGS, Layer.TAG_POINTS} & set(found)
    assert {Layer.SCAN, Layer.POINTS, Layer.TRUTH, Layer.KEYPOINTS} <= set(found)
