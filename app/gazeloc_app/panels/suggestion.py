"""Part of the panel of keypoints: the next best place to click, why, and the way there."""

from __future__ import annotations

from collections.abc import Callable

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.pairs import SelectPair
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.actions.suggest import ShowSuggestions
from gazeloc_app.keypoints.suggestions import Proposal, Proposals
from gazeloc_app.state import AppState
from gazeloc_core.keypoints import Point


class SuggestionPanel:
    """A switch, the sentence, and two buttons."""

    def __init__(
        self,
        gui: GuiApi,
        proposals: Proposals,
        dispatch: Callable[[Action], None],
        go_to: Callable[[int, Point], None],
        draw: Callable[[Point | None], None],
    ):
        """`go_to(client_id, place)` shows one browser a place in the frame `scan`; `draw` shows it in the scene."""
        self._proposals, self._dispatch, self._go_to, self._draw = proposals, dispatch, go_to, draw
        self._proposal: Proposal | None = None
        self._switch = gui.add_checkbox(
            "Suggest a place",
            True,
            hint="Shows where one more pair would make the cameras most certain, and what it is expected to do.",
        )
        self._text = gui.add_html("")
        self._go = gui.add_button("Go there", color="gray", hint="Moves this browser's view before the place.")
        self._start = gui.add_button(
            "Start a pair there",
            color="gray",
            hint="A new pair whose side of the reconstruction is this point; then click the same place on the scan.",
        )
        widgets.on_user(self._switch, lambda event: dispatch(ShowSuggestions(bool(event.target.value))))
        widgets.on_user(self._go, lambda event: self._went(event.client_id), event="on_click")
        widgets.on_user(self._start, lambda _: self._started(), event="on_click")

    def render(self, state: AppState) -> None:
        """Show the proposal for the state's pairs."""
        self._proposal = self._proposals.of(state)
        widgets.set_value(self._switch, state.layers.suggests)
        text = "" if self._proposal is None else self._proposal.text
        if state.layers.suggests and self._proposal is None:
            text = "There is no place to suggest before there is a reconstruction."
        widgets.set_content(self._text, widgets.box(widgets.text(text)) if text else "")
        for handle in (self._go, self._start):
            widgets.set_property(handle, "visible", self._proposal is not None)
        self._draw(None if self._proposal is None else self._proposal.in_scan)

    def _went(self, client_id: int) -> None:
        if self._proposal is not None:
            self._go_to(client_id, self._proposal.in_scan)

    def _started(self) -> None:
        if self._proposal is not None:
            self._dispatch(SelectPair(None))
            self._dispatch(PickPoint(Side.SFM, self._proposal.in_sfm))
