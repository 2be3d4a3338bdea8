"""What a step changed of what shows in the scene, in words."""

from __future__ import annotations

from gazeloc_app.state import Annotation, Layer, LayerSettings
from gazeloc_core.methods import Method


def describe_layers(before: LayerSettings, after: LayerSettings) -> list[str]:
    """E.g. “Scan hidden”; a sentence for each kind of change."""
    found: list[str] = []
    for names, word in (
        ([layer.value for layer in Layer if layer in before.hidden - after.hidden], "shown"),
        ([layer.value for layer in Layer if layer in after.hidden - before.hidden], "hidden"),
        ([method.value for method in Method if method in after.compared - before.compared], "shown for comparison"),
        ([method.value for method in Method if method in before.compared - after.compared], "no longer compared"),
    ):
        if names:
            found.append(f"{', '.join(names)} {word}")
    if before.coloring is not after.coloring:
        found.append(f"Cameras coloured by {after.coloring.value}")
    if before.thinning != after.thinning:
        found.append(_thinning(after.thinning))
    if before.draws_tags != after.draws_tags:
        found.append(f"Tags {'drawn' if after.draws_tags else 'no longer drawn'} into frames")
    if before.suggests != after.suggests:
        found.append(f"Next best place {'shown' if after.suggests else 'hidden'}")
    return found


def describe_comparison(after: Annotation) -> str:
    """Whose render shows beside that of the poses that are shown."""
    return f"Renders compared with {after.compared_with}" if after.compared_with else "Renders no longer compared"


def _thinning(step: int | None) -> str:
    if step is None:
        return "As many cameras drawn as fit"
    return "Every camera drawn" if step == 1 else f"One camera in {step} drawn"
