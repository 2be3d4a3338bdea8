"""What a step of the history did, as a short sentence: told from the annotations before and after it."""

from __future__ import annotations

from gazeloc_app.annotation.layer_steps import describe_comparison, describe_layers
from gazeloc_app.state import Annotation, Layer
from gazeloc_core.frames.marks import FrameMarks
from gazeloc_core.keypoints import KeypointPair, KeypointSet
from gazeloc_core.surfaces.saved_views import SavedView


def describe(before: Annotation, after: Annotation) -> str:
    """E.g. “Keypoint 3 placed on the scan”."""
    found: list[str] = []
    if before.keypoints != after.keypoints:
        found.append(_keypoints(before.keypoints, after.keypoints))
    if before.alignment != after.alignment:
        found.append(f"Alignment {after.alignment} put in force" if after.alignment else "No alignment in force")
    elif before.alignment_by_person != after.alignment_by_person:
        found.append("Alignment chosen by a person" if after.alignment_by_person else "Alignment left to the run")
    if before.method is not after.method:
        found.append(f"Method {after.method} chosen")
    if before.marks != after.marks:
        found.append(_marks(before.marks, after.marks))
    if before.views != after.views:
        found.append(_views(before.views, after.views))
    if before.tints != after.tints:
        found.append(_tints(before, after))
    found += describe_layers(before.layers, after.layers)
    if before.compared_with != after.compared_with:
        found.append(describe_comparison(after))
    if before.is_live != after.is_live and not (found and before.alignment != after.alignment):
        found.append(f"Alignment {'follows' if after.is_live else 'no longer follows'} the keypoints")
    return "; ".join(found) or "Nothing changed"


def _keypoints(before: KeypointSet, after: KeypointSet) -> str:
    was, now = {pair.key: pair for pair in before}, {pair.key: pair for pair in after}
    gone, new = [was[key] for key in was if key not in now], [now[key] for key in now if key not in was]
    changed = [key for key in now if key in was and now[key] != was[key]]
    if len(gone) + len(new) + len(changed) > 1:
        counts = ((len(new), "added"), (len(changed), "changed"), (len(gone), "deleted"))
        return "Keypoints: " + ", ".join(f"{count} {what}" for count, what in counts if count)
    if gone:
        return f"{gone[0].name} deleted"
    if new:
        return _change(KeypointPair(new[0].key, new[0].name), new[0])
    return _change(was[changed[0]], now[changed[0]]) if changed else "Keypoints put in another order"


def _marks(before: FrameMarks, after: FrameMarks) -> str:
    was, now = ({one.frame_index: one for one in marks.marks} for marks in (before, after))
    frames = sorted(index for index in was.keys() | now.keys() if was.get(index) != now.get(index))
    if len(frames) > 1:
        return f"{len(frames)} frames marked"
    one, earlier = now.get(frames[0]), was.get(frames[0])
    if one is None:
        return f"Frame {frames[0]} no longer marked"
    if earlier is not None and earlier.mark is one.mark:
        return f"Note of frame {frames[0]} changed"
    return f"Frame {frames[0]} marked {one.mark}"


def _views(before: tuple[SavedView, ...], after: tuple[SavedView, ...]) -> str:
    gone, new = [view for view in before if view not in after], [view for view in after if view not in before]
    if len(gone) > 1 or len(new) > 1:
        return "Saved views changed"
    if gone and new:
        is_same = gone[0].name == new[0].name
        return f"View “{new[0].name}” saved anew" if is_same else f"View “{gone[0].name}” renamed to “{new[0].name}”"
    if not gone and not new:
        return "Saved views put in another order"
    return f"View “{new[0].name}” saved" if new else f"View “{gone[0].name}” removed"


def _tints(before: Annotation, after: Annotation) -> str:
    layers = [layer for layer in Layer if before.tint(layer) != after.tint(layer)]
    names = ", ".join(layer.value for layer in layers) or "layers"
    return f"Colour of {names} " + ("changed" if any(after.tint(layer) for layer in layers) else "put back to its own")


def _change(was: KeypointPair, now: KeypointPair) -> str:
    name = now.name
    if was.name != now.name:
        return f"{was.name} renamed to {name}"
    if was.enabled != now.enabled:
        return f"{name} {'counts again' if now.enabled else 'no longer counts'}"
    if was.scan != now.scan or was.scan_sightings != now.scan_sightings:
        clicked = len(now.scan_sightings) > len(was.scan_sightings)
        return f"{name} {'clicked in the phone’s frame' if clicked else _placed(was.scan, now.scan) + ' on the scan'}"
    if was.sfm != now.sfm or was.sightings != now.sightings:
        if len(now.sightings) > len(was.sightings):
            return f"{name} clicked in frame {now.sightings[-1].frame_index}"
        return f"{name} {_placed(was.sfm, now.sfm)} in the reconstruction"
    return f"{name} changed"


def _placed(was: object, now: object) -> str:
    if now is None:
        return "taken away"
    return "placed" if was is None else "moved"
