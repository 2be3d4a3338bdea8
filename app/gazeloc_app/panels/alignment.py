"""Panel: align, refine with ICP, and the evidence before and after, in words and numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.choices import ChooseAlignment
from gazeloc_app.actions.jobs import StartJob
from gazeloc_app.actions.live import FollowKeypoints
from gazeloc_app.data import ProjectData
from gazeloc_app.keypoints.live_alignment import is_following
from gazeloc_app.panels.meanwhile import meanwhile
from gazeloc_app.state import AppState, Level
from gazeloc_app.work import tasks
from gazeloc_core.alignment.alignment import Alignment, AlignmentMethod

NONE = "(none)"
NEWEST_FITS = 6
"""So many fits to keypoints are listed; a click makes a new one each."""
METHODS = {
    "keypoints": "keypoints",
    "icp-point-to-point": "ICP, point to point",
    "icp-point-to-plane": "ICP, point to plane",
    "shape": "shape alone",
    "given": "given",
}


NONE_YET = (
    "The reconstruction stands in the middle of the scan until it has one. Tags that both saw, or three keypoints, "
    "make one: press Align."
)
NO_MODEL = "There is no reconstruction to align yet: “Run everything” in the tab Project makes it and aligns it."


class AlignmentPanel:
    """The buttons, the alignments there are, and what speaks for the one in force."""

    def __init__(self, gui: GuiApi, data: ProjectData, dispatch: Callable[[Action], None]):
        self._data = data
        self._dispatch = dispatch
        self._state: AppState | None = None
        self._seen: object = None
        self._keys: dict[str, str | None] = {NONE: None}
        self._align = gui.add_button("Align", hint="Fits the tags' corners and the keypoints that count.")
        self._live = gui.add_checkbox(
            "Follow the keypoints",
            True,
            hint="Fits anew at every change of the keypoints, without a button; undo takes both back. Off while an "
            "alignment of ICP or one that was chosen below is in force: switched on, the fit takes its place.",
        )
        self._note = gui.add_html("")
        self._refine = gui.add_button(
            "Refine with ICP",
            color="gray",
            hint="Both variants are shown; the better one is used only if keypoints that ICP did not use say so.",
        )
        self._chosen = gui.add_dropdown("In force", (NONE,), hint="Of fits to keypoints the newest; undo works.")
        self._evidence = gui.add_html("")
        widgets.on_user(self._align, lambda _: self._start("Align", tasks.align), event="on_click")
        widgets.on_user(self._live, lambda event: dispatch(FollowKeypoints(bool(event.target.value))))
        widgets.on_user(self._refine, lambda _: self._start_refinement(), event="on_click")
        widgets.on_user(self._chosen, lambda event: self._choose(str(event.target.value)))

    def render(self, state: AppState) -> None:
        """Show the state's alignment."""
        self._state = state
        for handle in (self._align, self._refine):
            widgets.set_property(handle, "disabled", state.has_job(handle.label))
        widgets.set_value(self._live, is_following(self._data, state))
        widgets.set_content(self._note, _note_html(state.fit_note))
        at_work = meanwhile(state, tasks.run_all, tasks.align)
        seen = (state.recording, state.annotation.alignment, state.data_revision, at_work)
        if seen == self._seen:
            return
        self._seen = seen
        alignments = _worth_listing(self._data.alignments(state.recording), state.annotation.alignment)
        self._keys = {NONE: None} | {_label(alignment): alignment.key for alignment in alignments}
        options = tuple(self._keys)
        if tuple(self._chosen.options) != options:
            self._chosen.options = options
        chosen = self._data.alignment(state.recording, state.annotation.alignment)
        widgets.set_value(self._chosen, NONE if chosen is None else _label(chosen))
        widgets.set_content(self._evidence, widgets.box(self._evidence_html(state, chosen)))

    def _evidence_html(self, state: AppState, chosen: Alignment | None) -> str:
        if chosen is None:
            none_yet = NO_MODEL if self._data.model(state.recording) is None else NONE_YET
            how = meanwhile(state, tasks.run_all, tasks.align) or none_yet
            return widgets.card("No alignment yet.", how)
        before = self._data.alignment(state.recording, chosen.parent)
        columns = [("", chosen)] if before is None else [("before", before), ("after", chosen)]
        rows = [[widgets.text(name), *(_cell(alignment) for _, alignment in columns)] for name, _cell in _ROWS]
        parts = [widgets.html_table(["", *(head for head, _ in columns)], rows)]
        parts += [
            f"<div>{widgets.colored('●', widgets.LEVEL_COLORS[verdict.level])} {widgets.text(verdict.text)}</div>"
            for verdict in chosen.verdicts
        ]
        reasons = (self._data.anchoring_reason(state.recording), *self._data.piece_reasons(state.recording))
        parts += [f"<div>{widgets.text(reason)}</div>" for reason in reasons if reason]
        refinement = self._data.refinement(state.recording)
        if refinement is not None and state.annotation.alignment in (
            refinement["start"],
            *(candidate["alignment"] for candidate in refinement["candidates"]),
        ):
            parts.append(_refinement_html(refinement))
        return "".join(parts)

    def _choose(self, label: str) -> None:
        if label in self._keys:
            self._dispatch(ChooseAlignment(self._keys[label]))

    def _start(self, name: str, task: Callable[..., Any], **keywords: Any) -> None:
        if self._state is not None:
            items = (("recording", self._state.recording), *keywords.items())
            self._dispatch(StartJob(name, task, items))

    def _start_refinement(self) -> None:
        key = self._state.annotation.alignment if self._state is not None else None
        if key is None:
            self._dispatch(Notify(Level.WARNING, "ICP needs a start: align by tags or keypoints first."))
        else:
            self._start("Refine with ICP", tasks.refine, start=key)


def _worth_listing(alignments: list[Alignment], in_force: str | None) -> list[Alignment]:
    """Without fits that were passed through while keypoints were clicked: of fits the newest, and the one in force."""
    fits = [alignment.key for alignment in alignments if alignment.method is AlignmentMethod.KEYPOINTS]
    passed = set(fits[:-NEWEST_FITS]) - {in_force}
    return [alignment for alignment in alignments if alignment.key not in passed]


def _note_html(note: str) -> str:
    if not note:
        return ""
    return widgets.box(widgets.colored(f"The keypoints as they are now give no alignment: {note}", widgets.WARNING))


def _label(alignment: Alignment) -> str:
    return f"{METHODS[alignment.method.value]} · {alignment.key}"


def _residual(alignment: Alignment) -> str:
    return widgets.centimetres(alignment.evidence.residual_rms_m)


def _left_out(alignment: Alignment) -> str:
    return widgets.centimetres(alignment.evidence.leave_one_out_rms_m)


def _inliers(alignment: Alignment) -> str:
    return f"{len(alignment.evidence.inliers)} of {len(alignment.evidence.keypoints)}"


def _tag_scale(alignment: Alignment) -> str:
    scale = alignment.evidence.tag_scale
    return "–" if scale is None else f"{100 * (scale - 1):+.1f} %"


def _cameras(alignment: Alignment) -> str:
    geometry = alignment.evidence.geometry
    return "–" if geometry is None else widgets.centimetres(geometry.camera_uncertainty_m)


def _rotation(alignment: Alignment) -> str:
    geometry = alignment.evidence.geometry
    return "–" if geometry is None else f"{geometry.rotation_uncertainty_deg:.2f}°"


_ROWS: tuple[tuple[str, Callable[[Alignment], str]], ...] = (
    ("Keypoints, RMS", _residual),
    ("Left out in turn, RMS", _left_out),
    ("Keypoints that agree", _inliers),
    ("Tag size against known", _tag_scale),
    ("Cameras uncertain by", _cameras),
    ("Rotation uncertain by", _rotation),
)


def _refinement_html(refinement: dict[str, Any]) -> str:
    rows = [
        [
            widgets.text(METHODS[candidate["method"]]),
            widgets.centimetres(candidate["keypoints_before_m"]),
            widgets.centimetres(candidate["keypoints_after_m"]),
            f"{100 * candidate['overlap_before']['share']:.0f} → {100 * candidate['overlap_after']['share']:.0f} %",
        ]
        for candidate in refinement["candidates"]
    ]
    color = widgets.GOOD if refinement["accepted"] else widgets.WARNING
    table = widgets.html_table(["ICP", "before", "after", "on the mesh"], rows)
    return f"<hr>{table}<div>{widgets.colored(refinement['reason'], color)}</div>"
