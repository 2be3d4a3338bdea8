"""The scene: draws the state with the layers of scene/. Each layer is touched only when what it shows has changed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import viser

from gazeloc_app.actions.action import Action
from gazeloc_app.data import ProjectData
from gazeloc_app.drawing.render_process import RenderProcess
from gazeloc_app.drawing.scan_screen import ScanScreen
from gazeloc_app.keypoints.dragging import Cloud, Dragging
from gazeloc_app.looks import set_background
from gazeloc_app.once import Once
from gazeloc_app.palette import FILTERED_OUT, SCAN_TAGS, SFM_TAGS
from gazeloc_app.placement import shown_scan_from_sfm
from gazeloc_app.scene.cameras import SceneCameras
from gazeloc_app.scene.cloud import CloudLayer
from gazeloc_app.scene.grid import GridLayer
from gazeloc_app.scene.kept import Kept
from gazeloc_app.scene.keypoints import KeypointsLayer
from gazeloc_app.scene.room import RoomLayer
from gazeloc_app.scene.shown_frame import ShownFrame
from gazeloc_app.scene.sizes import size_factor
from gazeloc_app.scene.tags import TagsLayer
from gazeloc_app.scene.view import set_start
from gazeloc_app.state import AppState, Layer
from gazeloc_core.charts.palette import colors_of_ids
from gazeloc_core.scan import Mesh
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.surfaces.glb import WHITE
from gazeloc_core.surfaces.scan_display import glimpse
from gazeloc_core.surfaces.viewpoint import room_corners
from gazeloc_core.transforms import Similarity

GLIMPSE_POINTS = 60_000


class SceneView:
    """All layers, and what each of them shows."""

    def __init__(
        self,
        server: viser.ViserServer,
        data: ProjectData,
        render: RenderProcess,
        dispatch: Callable[[Action], None],
        kept: Callable[[int], Kept],
    ):
        """`kept(client_id)` is what a browser's cuts leave of the room."""
        self._server, self._data, self._render = server, data, render
        self._screen = ScanScreen(data, render, dispatch)
        scene = server.scene
        set_background(scene)
        self._once = Once()
        self._mesh: Mesh | None = None
        self.front = 0
        """Which side of the scan's faces is drawn: 1 where their normals point to, -1 the other, 0 both."""
        self._room = RoomLayer(scene)
        self._grid = GridLayer(scene)
        self._glimpse = CloudLayer(scene, "/scan-glimpse", point_size_m=0.015)
        self._cloud = CloudLayer(scene)
        self._tag_points = CloudLayer(scene, "/sfm/tag-points", point_size_m=0.022)
        self._scan_tags = TagsLayer(scene, "scan", SCAN_TAGS)
        self._sfm_tags = TagsLayer(scene, "sfm", SFM_TAGS, suffix="′")
        self.cameras = SceneCameras(scene, data)
        self._dragging = Dragging(data, lambda: self.front, dispatch, kept)
        self._keypoints = KeypointsLayer(scene, on_drag=self._dragging)
        self._frame = ShownFrame(server, data, render)

    def render(self, state: AppState) -> None:
        """Draw the state."""
        scan_from_sfm = shown_scan_from_sfm(self._data, state)
        trajectory = self._data.trajectory(state.recording, self._data.poses_key(state.recording, state.annotation))
        self._draw_scan(state)
        self._draw_reconstruction(state, scan_from_sfm)
        self._draw_tags(state, scan_from_sfm)
        self.cameras.render(state)
        self._once(
            "keypoints",
            (state.annotation.keypoints, state.selected_key, scan_from_sfm),
            lambda: self._draw_keypoints(state, scan_from_sfm),
        )
        self._frame.show(state.recording, state.frame, trajectory, is_playing=state.is_playing)
        self._show_and_hide(state)

    def _draw_keypoints(self, state: AppState, scan_from_sfm: Similarity | None) -> None:
        with self._server.atomic():  # a step of many keypoints shows whole in every page, or not yet
            self._keypoints.show(state.annotation.keypoints, scan_from_sfm, state.selected_key)

    def stop(self) -> None:
        """Draw nothing any more."""
        self._frame.stop()

    def facts(self, state: AppState) -> tuple[str, ...]:
        """Sentences about what is drawn with less than there is."""
        found = []
        display, model = self._screen.display(), self._data.model(state.recording)
        if display is None:
            found.append("The scan is being made fit for the screen; some of its points show meanwhile.")
        elif display.faces < display.faces_of_scan:
            found.append(f"{display.faces:,} of {display.faces_of_scan:,} triangles are drawn; clicks use all.")
        if model is not None and self._cloud.drawn < len(model.points):
            found.append(f"{self._cloud.drawn:,} of {len(model.points):,} points are drawn; clicks use all.")
        return tuple(found)

    def _draw_scan(self, state: AppState) -> None:
        mesh = self._data.mesh()
        if mesh is not self._mesh:
            if self._mesh is not None:  # the scan got colours: the pictures of it are outdated
                self._render.reopen()
            self._mesh = mesh
            set_start(self._server, mesh, self._data.scan().up_axis)
            corners = room_corners(mesh)
            self._grid.show(*corners, self._data.scan().up_axis)
            self._keypoints.size = size_factor(*corners)
            self._frame.resize(self._keypoints.size)
        display = self._screen.display()
        if display is not None:
            self.front = display.front
            self._glimpse.show(None, None)
            self._room.set_look(state.annotation.tint(Layer.SCAN) or WHITE, two_sided=self.front == 0)
            self._room.show(display.glb)
        elif self._room.is_empty:
            self._once("glimpse", mesh, lambda: self._glimpse.show(*glimpse(mesh, GLIMPSE_POINTS)))

    def _draw_reconstruction(self, state: AppState, scan_from_sfm: Similarity | None) -> None:
        model, tint = self._data.model(state.recording), state.annotation.tint(Layer.POINTS)
        self._once(
            "points",
            (model, tint),
            lambda: self._cloud.show(
                None if model is None else model.points, None if model is None else model.point_colors, tint
            ),
        )
        if state.layers.is_visible(Layer.TAG_POINTS):
            self._draw_tag_points(state, model)
        self._dragging.cloud = None if model is None or scan_from_sfm is None else Cloud(model, scan_from_sfm)
        if scan_from_sfm is not None:
            for layer in (self._cloud, self._tag_points):
                layer.align(scan_from_sfm)

    def _draw_tag_points(self, state: AppState, model: SfmModel | None) -> None:
        found = self._data.tag_points(state.recording)

        def show() -> None:
            if found is None or model is None:
                self._tag_points.show(None, None)
                return
            colors = np.where(found.is_kept[:, None], colors_of_ids(found.point_tag), FILTERED_OUT).astype(np.uint8)
            self._tag_points.show(model.points[found.point], colors)

        self._once("tag points", found, show)

    def _draw_tags(self, state: AppState, scan_from_sfm: Similarity | None) -> None:
        on_scan, in_sfm = self._data.scan_tags(), self._data.sfm_tags(state.recording)
        self._once("scan tags", on_scan, lambda: self._scan_tags.show(on_scan))
        place = None if scan_from_sfm is None else _numbers(scan_from_sfm)
        self._once("sfm tags", (in_sfm, place), lambda: self._sfm_tags.show(in_sfm, scan_from_sfm))

    def _show_and_hide(self, state: AppState) -> None:
        cameras = self.cameras
        compared = [layer.set_visible for layer in cameras.compared.values()]
        switches: dict[Layer, tuple[Callable[[bool], None], ...]] = {
            Layer.SCAN: (self._room.set_visible, self._glimpse.set_visible),
            Layer.POINTS: (self._cloud.set_visible,),
            Layer.SCAN_TAGS: (self._scan_tags.set_visible,),
            Layer.SFM_TAGS: (self._sfm_tags.set_visible,),
            Layer.PHONE: (cameras.phone.set_visible,),
            Layer.TRUTH: (cameras.truth.set_visible,),
            Layer.ESTIMATE: (cameras.estimate.set_visible, self._frame.show_camera, *compared),
            Layer.KEYPOINTS: (self._keypoints.set_visible,),
            Layer.TAG_POINTS: (self._tag_points.set_visible,),
            Layer.GAZE: (self._frame.show_gaze,),
            Layer.ERRORS: (cameras.errors.set_visible,),
            Layer.GRID: (self._grid.set_visible,),
        }
        for layer, of_layer in switches.items():
            is_visible = state.layers.is_visible(layer)
            self._once(f"visible {layer}", is_visible, partial(_switch, of_layer, is_visible))


def _switch(switches: Sequence[Callable[[bool], None]], is_visible: bool) -> None:
    for switch in switches:
        switch(is_visible)


def _numbers(similarity: Similarity) -> tuple[float, ...]:
    return tuple(similarity.as_matrix().ravel().tolist())
