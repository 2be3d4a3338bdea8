"""The real chair: import self-check, and end to end with keypoints clicked in frames, through the app's own actions.

By the paper's protocol: every other picture plays the glasses, ARKit's poses are the truth. The person who clicks is
simulated: they recognise a place in pictures of both halves (chair_places.py) and click it there.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from chair_places import Place, find_places
from gazeloc_app.actions.pairs import SelectPair
from gazeloc_app.actions.picks import PickPoint, PickSighting, Side
from gazeloc_app.data import ProjectData
from gazeloc_app.frames.sightings import triangulated
from gazeloc_app.state import AppState

from gazeloc_core import pipeline
from gazeloc_core.arrays import Floats, Ints
from gazeloc_core.evaluation.protocol import make_protocol_project
from gazeloc_core.keypoints import Sighting
from gazeloc_core.project import Project
from gazeloc_core.readers import depth_agreement, open_scan

Row = tuple[str, str, bool]
CLICKS = 8
DRAWS = 20
CLICK_ERROR_PX = 1.5
SURFACE_ERROR_M = 0.005
NAME = "chair"


def bench_chair(source: Path, work: Path) -> list[Row]:
    """Both facts about the chair scan."""
    agreement = depth_agreement(open_scan(source, colored=False), frames_checked=100)
    row = (
        "chair: lidar depth against the ray-cast mesh, median (<= 1.5 cm)",
        f"{100 * agreement.median_m:.2f} cm over {agreement.frames} frames, {agreement.share_hit:.0%} hit",
        agreement.median_m <= 0.015,
    )
    return [row, *_end_to_end(source, work)]


def _end_to_end(source: Path, work: Path) -> list[Row]:
    project = make_protocol_project(work / "chair", source, name=NAME)
    pipeline.run(project, until="reconstruction")
    places = find_places(source, work / "places")
    in_frames, registered = _errors(project, places, on_mesh=False)
    on_mesh, _ = _errors(project, places, on_mesh=True)
    (position, rotation), worst = in_frames.mean(axis=0), in_frames.max(axis=0)
    what = f"chair end to end, {CLICKS} keypoints clicked in frames, {DRAWS} draws, against ARKit"
    return [
        (
            f"{what} (<= 3 cm, <= 1.5°)",
            f"{100 * position:.2f} cm, {rotation:.2f}° (worst {100 * worst[0]:.1f} cm, {worst[1]:.1f}°), {registered}",
            bool(position <= 0.03 and rotation <= 1.5),
        ),
        (
            "    the same with the scan's side clicked on the mesh instead",
            f"{100 * on_mesh[:, 0].mean():.2f} cm, {on_mesh[:, 1].mean():.2f}°",
            True,
        ),
    ]


def _errors(project: Project, places: list[Place], *, on_mesh: bool) -> tuple[Floats, str]:
    """Mean position and rotation errors (DRAWS, 2) of the poses that the stages make of each draw's keypoints."""
    data, errors = ProjectData(project), []
    for draw in range(DRAWS):
        state = clicked_keypoints(data, places, np.random.default_rng(draw), on_mesh=on_mesh)
        project.save_keypoints(NAME, state.annotation.keypoints)
        pipeline.run(project)
        evaluation = pipeline.evaluate_recording(project, NAME)
        errors.append((evaluation.position_m.mean, evaluation.rotation_deg.mean))
    return np.array(errors), f"{evaluation.registered} of {evaluation.keyframes} frames"


def clicked_keypoints(
    data: ProjectData, places: list[Place], rng: np.random.Generator, *, on_mesh: bool = False
) -> AppState:
    """The state after a careful person has clicked distinct places, far apart, on both sides.

    On each side they click a place in its first, middle and last frame, with an error of 1.5 px. With `on_mesh` they
    click the scan's side once on the mesh instead, whose colours come from the phone's pictures: they see the place
    where those frames' rays meet it, and click with an error of 5 mm.
    """
    state = AppState((NAME,), NAME)
    for chosen in _far_apart(np.array([place.rough for place in places]), rng):
        place = places[chosen]
        state = SelectPair(None).apply(state)
        if on_mesh:
            seen_at = _on_mesh(data, place)
            if seen_at is None:
                continue
            x, y, z = (float(value) for value in seen_at + rng.normal(0, SURFACE_ERROR_M, 3))
            state = PickPoint(Side.SCAN, (x, y, z)).apply(state)
        else:
            state = _click_in_frames(data, state, place.phone, place.phone_px, Side.SCAN, rng)
        state = _click_in_frames(data, state, place.glasses, place.glasses_px, Side.SFM, rng)
        if sum(pair.counts for pair in state.annotation.keypoints) == CLICKS:
            break
    return state


def _click_in_frames(
    data: ProjectData, state: AppState, frames: Ints, pixels: Floats, side: Side, rng: np.random.Generator
) -> AppState:
    """The state after one place was clicked in its first, middle and last frame."""
    sightings: tuple[Sighting, ...] = ()
    for row in (0, len(frames) // 2, len(frames) - 1):
        x, y = pixels[row] + rng.normal(0, CLICK_ERROR_PX, 2)
        sightings = (*sightings, Sighting(int(frames[row]), float(x), float(y)))
        found = triangulated(data, NAME, sightings, side) if len(sightings) > 1 else None
        known = (None, None) if found is None or isinstance(found, str) else found  # the app says why and waits
        state = PickSighting(sightings[-1], state.selected_key, *known, side=side).apply(state)
    return state


def _on_mesh(data: ProjectData, place: Place) -> Floats | None:
    """Where the place is seen on the coloured mesh; None where the frames put it at places more than 5 cm apart."""
    frames, raycaster = data.scan().frames_with_images, data.raycaster()
    found = []
    for frame, pixel in zip(place.phone.tolist(), place.phone_px, strict=True):
        pose = frames[frame].scan_from_camera
        ray = pose.rotation.as_matrix() @ frames[frame].camera.unproject(pixel)[0]
        found.append(raycaster.points(raycaster.cast(np.asarray(pose.translation), ray))[0])
    middle = np.median(found, axis=0)
    return middle if np.isfinite(found).all() and np.linalg.norm(found - middle, axis=1).max() < 0.05 else None


def _far_apart(places: Floats, rng: np.random.Generator) -> list[int]:
    """Places in the order in which a person spreads them: each far from those before, not always the very farthest."""
    chosen = [int(rng.integers(len(places)))]
    nearest = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < min(4 * CLICKS, len(places)):
        far = np.argsort(-nearest)[: max(1, len(places) // 20)]
        chosen.append(int(rng.choice(far)))
        nearest = np.minimum(nearest, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return chosen
