"""Tools in a real browser: the tape, saved views, snapping, suggestions, colours, the trajectory, problems, files."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from app_project import MARKS, TAG_SIZE_M, make_app_project, mark_corners, true_poses, with_poses
from e2e.app_page import AppPage
from gazeloc_app.actions.jobs import StartJob
from gazeloc_app.app import App
from gazeloc_app.palette import STATUSES
from gazeloc_app.scene.cameras import Coloring
from gazeloc_app.tools.scan_point import ScanPointTool
from gazeloc_app.tools.tape import TapeTool
from gazeloc_app.work import tasks
from gazeloc_app.work.job_list import JobList

pytestmark = pytest.mark.e2e

CAMERA = """() => {
  const m = window.__viserMutable;
  m.nodeRefFromName[''].updateWorldMatrix(true, false);
  return {world: m.nodeRefFromName[''].matrixWorld.elements, eye: m.camera.position.toArray()};
}"""


@pytest.fixture
def project(tmp_path):
    return with_poses(make_app_project(tmp_path))


@pytest.fixture
def page(app, open_page):
    viewer = open_page(app.address, width=1360, height=760).wait_until_drawn(300).wait_for_clicks()
    return AppPage(viewer, app)


def eye_in_scan(page):
    """Where the page's camera is."""
    found = page.page.evaluate(CAMERA)
    world_from_scan = np.reshape(found["world"], (4, 4)).T
    return (np.linalg.inv(world_from_scan) @ [*found["eye"], 1.0])[:3]


def until_the_eye_is(page, place, off_m=0.02):
    page.viewer.wait_until(lambda: np.linalg.norm(eye_in_scan(page) - place) < off_m)


def has_said(page, text):
    """Whether a job has ended, or something was refused, with this in its sentence."""
    return page.state.job is None and page.state.notice is not None and text in page.state.notice.text


def test_two_clicks_measure_a_distance_in_this_browser_alone_and_a_third_begins_anew(page, open_page):
    other = open_page(page.app.address, width=700, height=500).wait_until_drawn(300)
    page.choose("A click", TapeTool.name)
    ends = np.array([(1.4, 0.0, 1.9), (3.4, 0.0, 0.7)])
    page.viewer.click_at_point(ends[0])
    page.viewer.wait_for_node("/tape/0")
    page.page.wait_for_timeout(300)
    page.viewer.click_at_point(ends[1])
    page.viewer.wait_for_node("/tape/line")
    page.viewer.save("tape")
    tapes = [browser.tool for browser in page.app.browsers.values() if isinstance(browser.tool, TapeTool)]
    measured = [np.linalg.norm(np.subtract(*tape._ends)) for tape in tapes]
    assert measured == pytest.approx([np.linalg.norm(ends[1] - ends[0])], abs=0.02)
    assert not other.page.evaluate("() => !!window.__viserMutable.nodeRefFromName['/tape/line']")
    page.page.wait_for_timeout(300)
    page.viewer.click_at_point(ends[0])
    page.viewer.wait_for_node("/tape/line", present=False)
    assert not page.pairs


def test_a_saved_view_is_gone_to_renamed_undone_and_there_after_a_restart(page, app):
    page.tab("Layers").field("New view").fill("the desk")
    saved_from = eye_in_scan(page)
    page.press("Save this view").until(lambda: [view.name for view in page.state.annotation.views] == ["the desk"])
    page.page.get_by_text("Top", exact=True).click()
    page.viewer.wait_until(lambda: np.linalg.norm(eye_in_scan(page) - saved_from) > 0.5)
    page.page.get_by_text("Go", exact=True).click()
    until_the_eye_is(page, saved_from)
    page.field("New view").fill("a better name")
    page.page.get_by_text("Rename", exact=True).click()
    page.until(lambda: [view.name for view in page.state.annotation.views] == ["a better name"])
    page.viewer.page.mouse.click(640, 20)
    page.page.keyboard.press("Control+z")
    page.until(lambda: [view.name for view in page.state.annotation.views] == ["the desk"])
    app.stop()
    again = App(app.project, port=0)
    assert [view.name for view in again.store.state.annotation.views] == ["the desk"]


def test_a_click_near_a_tags_corner_means_that_corner(page):
    corner = mark_corners().corners[list(MARKS).index(2)][0]
    page.choose("A click", ScanPointTool.name)
    towards_the_middle = np.array([-1.0, 0.0, -1.0]) * 0.12 * TAG_SIZE_M / np.sqrt(2)
    page.click_for(corner + towards_the_middle, lambda: len(page.pairs))
    assert np.linalg.norm(np.array(page.pairs[0].scan) - corner) < 0.01


def test_the_suggested_place_says_why_is_gone_to_and_becomes_a_pair(page):
    page.tab("Keypoints")
    page.page.get_by_text("Start a pair there", exact=True).wait_for()
    before = eye_in_scan(page)
    page.press("Go there")
    page.viewer.wait_until(lambda: np.linalg.norm(eye_in_scan(page) - before) > 0.1)
    page.viewer.save("suggestion")
    page.press("Start a pair there").until(lambda: len(page.pairs) == 1)
    in_sfm = np.array(page.pairs[0].sfm)
    assert np.linalg.norm(page.app.data.model("walk").points - in_sfm, axis=1).min() < 1e-6


def test_cameras_take_the_colour_of_how_they_came_by_their_pose(page):
    page.tab("Layers").choose("Colour by", Coloring.STATUS.value)
    page.until(lambda: page.state.layers.coloring is Coloring.STATUS)
    page.field("Ground truth").click()
    page.viewer.settle()
    registered = np.array(true_poses().translation)[::2]
    wanted = next(color for status, color in STATUSES.items() if status == "registered")
    page.viewer.wait_until(lambda: min(page.pixels_near(place, wanted) for place in registered) > 3)
    page.viewer.save("coloured-by-status")
    assert page.page.get_by_text("registered").count() >= 1


def test_the_view_follows_the_trajectory_only_where_it_is_asked_to(page):
    poses = page.app.data.trajectory("walk", page.app.data.poses_key("walk", page.state.annotation))
    page.press("Look through this camera")
    until_the_eye_is(page, poses.pose(page.state.frame).translation)
    page.page.mouse.click(640, 20)
    page.page.keyboard.press("l")
    page.until(lambda: page.state.frame == 1)
    until_the_eye_is(page, poses.pose(1).translation)
    page.field("Follow the trajectory").click()
    page.page.mouse.click(640, 20)
    page.page.keyboard.press("l")
    page.until(lambda: page.state.frame == 2)
    page.page.wait_for_timeout(1500)
    until_the_eye_is(page, poses.pose(1).translation)
    assert np.linalg.norm(poses.pose(2).translation - poses.pose(1).translation) > 0.05


def test_the_worst_frames_are_listed_gone_to_marked_and_exported_with_their_note(page, app):
    page.page.get_by_role("tab", name="Problems", exact=True).click()
    page.press("Score the frames").until(lambda: has_said(page, "scored"), 120)
    first = page.page.locator(".gazeloc-frames a").first
    first.wait_for()
    worst = int(first.locator("b").inner_text().split()[1])
    scores = app.data.frame_scores("walk", app.data.poses_key("walk", page.state.annotation))
    assert scores.score[worst] == np.nanmin(scores.score)
    first.click()
    page.until(lambda: page.state.frame == worst)
    page.page.keyboard.press("b")
    page.tab("Frame").field("Note").fill('the door, "open" <b>')
    page.field("Note").press("Tab")
    page.until(
        lambda: page.state.annotation.marks.get(worst) is not None and page.state.annotation.marks.get(worst).note
    )
    page.tab("Export").press("Export")
    page.until(lambda: has_said(page, "files were written"), 120)
    with (app.project.folder / "export" / "csv" / "poses.csv").open(newline="") as file:
        row = next(row for row in csv.DictReader(file) if row["frame index"] == str(worst))
    assert (row["mark"], row["note"]) == ("bad", 'the door, "open" <b>')


def test_keypoints_are_read_from_a_file_of_this_computer_and_saved_to_one(page, tmp_path):
    page.tab("Keypoints")
    page.page.get_by_text("Files", exact=True).click()
    file = tmp_path / "mine.csv"
    file.write_text(
        "name,scan_x_m,scan_y_m,scan_z_m,sfm_x,sfm_y,sfm_z\nsocket,1.5,0,1.9,,,\ndoor,0,1.3,1.9,0.1,0.2,0.3\n"
    )
    with page.page.expect_file_chooser() as chosen:
        page.press("Read keypoints")
    chosen.value.set_files(str(file))
    page.until(lambda: [pair.name for pair in page.pairs] == ["socket", "door"])
    with page.page.expect_download() as saved:
        page.press("Save keypoints")
    written = json.loads((saved.value.path()).read_text())
    assert [pair["name"] for pair in written] == ["socket", "door"]
    file.write_text("name,scan_x_m,scan_y_m,scan_z_m\nsocket,far away,1,2\n")
    with page.page.expect_file_chooser() as chosen:
        page.press("Read keypoints")
    chosen.value.set_files(str(file))
    page.until(lambda: has_said(page, "mine.csv"))
    assert len(page.pairs) == 2
    page.page.mouse.click(640, 20)
    page.page.keyboard.press("Control+z")
    page.until(lambda: not page.pairs)


def test_what_was_under_way_when_it_ended_is_offered_and_goes_on(page, app, open_page):
    before = page.state
    app.stop()
    align = StartJob("Align", tasks.align, (("recording", "walk"),))
    JobList(app.project, app.project.folder / "export", print).save(before, align.apply(before))
    again = App(app.project, port=0)
    again.start()
    try:
        page = AppPage(open_page(again.address, width=1200, height=700).wait_until_drawn(300), again)
        page.page.get_by_text("GazeLoc was ended while it worked on “Align”.").wait_for()
        assert page.state.job is None
        page.press("Go on with Align").until(lambda: has_said(page, "Aligned"), 120)
        assert page.page.get_by_role("button", name="Go on with Align").count() == 0
    finally:
        again.stop()
