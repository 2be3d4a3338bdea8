"""The app in a real browser: the whole way from clicks to exported poses, looked at by pixels, state and files."""

from __future__ import annotations

import json

import numpy as np
import pytest
from app_project import BOXES, SFM_FROM_SCAN, WALLS, true_poses
from e2e.app_page import AppPage
from gazeloc_app.palette import USUAL
from gazeloc_app.state import Layer
from gazeloc_app.tools.camera import CameraTool
from gazeloc_app.tools.cloud_point import CloudPointTool
from gazeloc_app.tools.frame_point import FramePointTool
from gazeloc_app.tools.scan_point import ScanPointTool

pytestmark = pytest.mark.e2e

SIZE = {"width": 1360, "height": 760}
SPOTS = np.array(
    [(1.5, 0.0, 1.9), (0.0, 1.3, 1.9), (3.4, 0.0, 0.7), (1.3, 0.4, 0.74), (2.8, 2.0, 0.45), (2.2, 1.2, 0.0)]
)


@pytest.fixture
def open_app(app, open_page):
    def open_app() -> AppPage:
        viewer = open_page(app.address, **SIZE).wait_until_drawn(300).wait_for_clicks()
        return AppPage(viewer, app)

    return open_app


def saved(project):
    return project.keypoints("walk").pairs


def align(page):
    page.tab("Align").press("Align").until(lambda: page.state.annotation.alignment and not page.state.job, 120)


def test_the_room_is_there_in_its_colours(open_app):
    page = open_app()
    page.tab("Layers").field("Reconstruction").click()  # its points lie in front of walls before it is aligned
    page.until(lambda: not page.state.layers.is_visible(Layer.POINTS))
    for name, point in {"floor": (3.3, 1.2, 0.0), "left": (0.0, 0.4, 2.2), "front": (2.0, 0.0, 2.2)}.items():
        assert page.viewer.color_at(point).tolist() == list(WALLS[name]), name
    assert page.viewer.color_at((2.75, 2.05, 0.45)).tolist() == list(BOXES["stool"][2])
    page.viewer.save("app-opened")


def test_clicks_on_the_mesh_make_keypoints_on_the_surface_under_the_pixel(open_app, project):
    page = open_app()
    page.choose("A click", ScanPointTool.name)
    page.field("Snap to tags").click()  # one of the spots is near a tag's corner
    for number, spot in enumerate(SPOTS, start=1):
        pixel = page.click_for(spot, lambda: len(page.pairs))
        clicked = np.array(page.pairs[-1].scan)
        assert len(page.pairs) == number
        assert np.abs(page.viewer.project(clicked)[0] - pixel).max() < 0.3, (
            spot
        )  # the canvas is no whole number of pixels high
        assert np.linalg.norm(clicked - spot) < 0.02, spot  # a pixel covers a centimetre and more of the floor
        page.page.wait_for_timeout(200)
        page.tab("Keypoints").choose("Selected", "(a new pair)")
        page.viewer.wait_until(lambda: page.state.selected_key is None)
    page.viewer.wait_for_node("/keypoints/k6/scan")
    page.viewer.save("app-clicked")
    assert [pair.scan for pair in saved(project)] == [pair.scan for pair in page.pairs]


def test_dragging_in_pick_mode_orbits_and_makes_nothing(open_app):
    page = open_app()
    page.choose("A click", ScanPointTool.name)
    before = page.viewer.project(SPOTS[:1])[0]
    mouse = page.page.mouse
    for _ in range(3):
        mouse.move(640, 400)
        mouse.down()
        mouse.move(690, 420, steps=5)
        mouse.up()
    page.viewer.settle()
    page.page.wait_for_timeout(500)
    assert np.linalg.norm(page.viewer.project(SPOTS[:1])[0] - before) > 10
    assert not page.pairs


def test_the_tool_is_of_one_browser_and_a_reload_forgets_nothing(open_app):
    first, second = open_app(), open_app()
    first.choose("A click", ScanPointTool.name)
    first.viewer.wait_until(lambda: any(isinstance(b.tool, ScanPointTool) for b in first.app.browsers.values()))
    second.viewer.click_at_point(SPOTS[0])
    second.page.wait_for_timeout(700)
    assert not first.pairs
    first.click_for(SPOTS[1], lambda: len(first.pairs))
    second.viewer.wait_for_node("/keypoints/k1/scan")

    first.page.reload()
    first.viewer.wait_until_drawn(300).wait_for_clicks().wait_for_node("/keypoints/k1/scan")
    first.viewer.wait_until(lambda: first.field("A click").input_value() == ScanPointTool.name)
    assert second.field("A click").input_value() == CameraTool.name
    assert len(first.pairs) == 1


def test_pairs_are_named_switched_deleted_undone_and_redone_by_hand(open_app, project):
    page = open_app()
    page.choose("A click", ScanPointTool.name)
    page.click_for(SPOTS[0], lambda: len(page.pairs))
    page.tab("Keypoints")
    page.until(lambda: page.field("Name").input_value() == "Keypoint 1")
    page.field("Name").fill("corner <b>of</b> the picture")
    page.until(lambda: page.pairs[0].name == "corner <b>of</b> the picture")
    assert page.page.locator("#gazeloc-pairs").get_by_text("corner <b>of</b> the picture").count() == 1
    page.field("Counts").click()
    page.until(lambda: not page.pairs[0].enabled)
    page.press("Delete the pair").until(lambda: not page.pairs)
    page.viewer.wait_for_node("/keypoints/k1/scan", present=False)
    page.press("Undo").until(lambda: len(page.pairs) == 1)
    page.viewer.wait_for_node("/keypoints/k1/scan")
    page.press("Undo").until(lambda: page.pairs[0].enabled)
    page.press("Redo").until(lambda: not page.pairs[0].enabled)
    page.until(lambda: saved(project) == page.pairs)


def test_the_key_p_goes_through_the_modes_and_says_which(open_app):
    page = open_app()
    page.page.mouse.click(5, 5)
    page.page.keyboard.press("p")
    page.page.get_by_text(f"A click {ScanPointTool.name}.").wait_for(timeout=10_000)
    assert page.field("A click").input_value() == ScanPointTool.name


def test_a_click_on_the_cloud_makes_a_point_of_the_reconstruction(open_app):
    page = open_app()
    align(page)
    page.choose("A click", CloudPointTool.name)
    page.click_for(SPOTS[3], lambda: len(page.pairs))
    in_sfm = np.array(page.pairs[0].sfm)
    assert np.linalg.norm(SFM_FROM_SCAN.inverse().apply(in_sfm) - SPOTS[3]) < 0.15
    assert np.linalg.norm(page.app.data.model("walk").points - in_sfm, axis=1).min() == 0


def test_one_spot_clicked_in_two_frames_is_a_keypoint_by_triangulation(open_app):
    page = open_app()
    spot = np.array([1.2, 0.35, 0.74])  # on the desk
    shown = lambda: [len(pair.sightings) for pair in page.pairs]  # noqa: E731
    page.choose("A click", FramePointTool.name)
    for count, frame in enumerate((0, 12), start=1):
        if frame:
            page.field("Frame").fill(str(frame))
            page.field("Frame").press("Enter")
            page.until(lambda frame=frame: page.state.frame == frame)
        else:
            page.press("Look through this camera")
        page.viewer.wait_for_node("/picture").wait_until_drawn(2)
        camera, browser = page.app.data.camera("walk"), next(iter(page.app.browsers.values()))
        page.until(lambda frame=frame, browser=browser: browser.looking.target == ("walk", frame))
        page.page.wait_for_timeout(1500)
        page.viewer.settle().save(f"app-look-through-{frame}")
        # Before the alignment the cameras are drawn at a likely place; the spot is where its pixel is in the picture.
        pixel = camera.project(true_poses()[frame].inv().apply(spot)[None])[0]
        page.click_for(_in_picture(page, frame, pixel), shown)
        assert shown() == [count]
        seen = page.pairs[0].sightings[-1]
        assert np.hypot(seen.x_px - pixel[0], seen.y_px - pixel[1]) < 1.5
    found = SFM_FROM_SCAN.inverse().apply(np.array(page.pairs[0].sfm))
    assert np.linalg.norm(found - spot) < 0.02
    page.press("Leave the frame")
    page.viewer.wait_for_node("/picture", present=False)


def _in_picture(page, frame, pixel):
    """The place in the scene at which a frame's picture shows a pixel."""
    from gazeloc_app.frames.sightings import frame_pose
    from gazeloc_app.scene.frames import PLANE_M

    camera = page.app.data.camera("walk")
    ray = np.array([*(pixel - camera.principal_point_px) / camera.focal_px, 1.0])
    return frame_pose(page.app.data, page.state, frame).apply(PLANE_M * ray)


def test_aligning_puts_red_cameras_where_the_glasses_were_and_clicking_one_goes_to_its_frame(open_app):
    page = open_app()
    registered = np.array(true_poses().translation)[::2]
    page.tab("Layers")
    page.field("Ground truth").click()
    page.until(lambda: bool(page.state.layers.hidden))
    assert [page.pixels_near(place, USUAL.estimate) for place in registered] == [0] * 8
    align(page)
    page.viewer.wait_for_node("/frusta/estimate")
    page.viewer.save("app-aligned")
    assert min(page.pixels_near(place, USUAL.estimate) for place in registered) > 5
    assert page.page.get_by_text("Keypoints, RMS").count() == 1
    page.viewer.click_at_point(registered[5])
    page.until(lambda: page.state.frame == 10)
    page.tab("Keypoints").press("Undo").until(lambda: page.state.annotation.alignment is None)
    page.viewer.wait_for_node("/frusta/estimate", present=False)


def test_refining_shows_its_evidence_and_can_be_undone(open_app):
    page = open_app()
    align(page)
    before = page.state.annotation.alignment
    page.press("Refine with ICP").until(lambda: page.app.data.refinement("walk") and not page.state.job, 120)
    page.page.locator("td").get_by_text("ICP, point to plane", exact=True).first.wait_for(timeout=10_000)
    page.viewer.save("app-refined")
    refinement = page.app.data.refinement("walk")
    assert page.page.get_by_text(refinement["reason"]).count() >= 1
    if refinement["accepted"]:
        assert page.state.annotation.alignment != before
        page.tab("Keypoints").press("Undo")
    page.until(lambda: page.state.annotation.alignment == before)


def test_the_slider_changes_frame_and_render_and_blend_and_wipe_are_the_pages_own(open_app):
    page = open_app()
    align(page)
    frame, render = (page.page.locator(f".gazeloc-comparison img[alt={alt}]") for alt in ("frame", "render"))
    is_loaded = "i => i.complete && i.naturalWidth > 0"
    sources = set()
    for number in (2, 7):
        page.field("Frame").fill(str(number))
        page.field("Frame").press("Enter")
        page.until(lambda number=number: f"/{number}.jpg" in (frame.get_attribute("src") or ""))
        for image in (frame, render):
            page.until(lambda image=image: image.evaluate(is_loaded))
            sources.add(image.get_attribute("src"))
    assert len(sources) == 4
    for label, variable, value, shown in (
        ("Wipe", "--gazeloc-wipe", "20", "20%"),
        ("Blend", "--gazeloc-blend", "40", "0.4"),
    ):
        page.page.get_by_role("radio", name=label, exact=True).click()
        page.page.get_by_label(label).and_(page.page.locator("input")).fill(value)
        read = f"getComputedStyle(document.documentElement).getPropertyValue('{variable}')"
        assert page.page.evaluate(read).strip() == shown
    page.field("Frame").fill("8")
    page.field("Frame").press("Enter")
    page.until(lambda: "/8.jpg" in (frame.get_attribute("src") or ""))
    page.page.get_by_role("radio", name="Wipe", exact=True).click()
    assert page.page.get_by_label("Wipe").and_(page.page.locator("input")).input_value() == "20"
    difference = page.page.evaluate(_DIFFERENCE)
    assert difference < 12  # the render from the estimated pose shows what the frame shows
    page.viewer.save("app-compared")


_DIFFERENCE = """
async () => {
  const images = [...document.querySelectorAll('.gazeloc-stage img')].slice(0, 2);
  await Promise.all(images.map(i => i.decode()));
  const data = images.map(i => {
    const c = new OffscreenCanvas(200, 180), x = c.getContext('2d');
    x.drawImage(i, 0, 0, 200, 180);
    return x.getImageData(0, 0, 200, 180).data;
  });
  let sum = 0;
  for (let k = 0; k < data[0].length; k++) sum += Math.abs(data[0][k] - data[1][k]);
  return sum / data[0].length * 4 / 3;
}
"""


def test_layers_are_hidden_and_shown(open_app):
    page = open_app()
    spot = (3.3, 1.2, 0.0)
    page.tab("Layers")
    for shown in (False, True):
        page.field("Scan").click()
        page.until(lambda shown=shown: page.viewer.color_at(spot).tolist() == list(WALLS["floor"]) or not shown)
        page.until(lambda shown=shown: (page.viewer.color_at(spot).tolist() == list(WALLS["floor"])) == shown)


def test_exporting_writes_files(open_app, project):
    page = open_app()
    align(page)
    page.tab("Export")
    page.field("TUM").click()
    page.field("nerfstudio").click()
    page.field("Folder").fill("first try")
    page.page.wait_for_timeout(500)
    page.press("Export").until(lambda: page.state.job is None and "files were written" in page.state.notice.text, 120)
    folder = project.folder / "export" / "first try"
    assert len((folder / "tum" / "poses.tum").read_text().splitlines()) >= 8
    transforms = json.loads((folder / "nerfstudio" / "transforms.json").read_text())
    assert len(transforms["frames"]) == 8
    page.viewer.save("app-exported")


def test_clicks_and_undos_from_two_browsers_at_once_are_all_applied_in_order_and_saved(open_app, project):
    pages = [open_app(), open_app()]
    for page in pages:
        page.choose("A click", ScanPointTool.name)
        page.tab("Keypoints")
    store = pages[0].app.store
    applied, history = store.applied, []
    store.add_effect(lambda before, after: history.append(len(after.annotation.keypoints)))
    page = pages[0]
    page.page.wait_for_timeout(500)
    count = 30
    for number in range(count):
        for which, one in enumerate(pages):
            if number % 5 == 4 and which:
                one.press("Undo")
            else:
                one.viewer.click_at_point(SPOTS[number % 3 + 3 * which] + (0.01 * (number % 7), 0.0, 0.0))
            one.page.wait_for_timeout(200)  # a person's pace: the page itself drops clicks that come closer together
    page.viewer.wait_until(lambda: store.applied >= applied + 2 * count, 60.0)
    page.page.wait_for_timeout(300)
    assert store.applied == applied + 2 * count
    assert saved(project) == page.pairs
    undone = count // 5
    assert len(page.pairs) == 2 * count - 2 * undone
