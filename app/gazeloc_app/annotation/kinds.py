"""Whose business each action and each field of the state is: what is a step of the history, and what is none.

What people decide about the project, they decide together: there is one scene for all browsers, so a layer that
somebody hides is gone from the others' screens too. So it has its line in the history and can be taken back by any of
them, as a keypoint can. What only one browser has (its camera, tool, cuts, wipe, light or dark) is no part of the
state and has no action: it stays on the client's handle or in the page.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum, auto

from gazeloc_app.actions import choices, files, history, jobs, live, marks, pairs, people, picks, places, playing, views
from gazeloc_app.actions.action import Notify
from gazeloc_app.actions.suggest import ShowSuggestions


class Kind(Enum):
    """Where a thing belongs."""

    DECISION = auto()
    """About the project: a step of the history, saved with the project before it is shown, so that kill -9 keeps it."""
    HISTORY = auto()
    """Going through the steps: saved as they are, but no step."""
    PLACE = auto()
    """Where everybody is just now (recording, frame, selected pair): the same in all browsers, no step."""
    SETTING = auto()
    """Of the user of this computer, in all projects; kept in their settings, no step."""
    NEWS = auto()
    """What is going on (jobs, people, sentences): nobody's decision."""


UNDONE = (
    "Every keypoint, alignment, method, comparison, mark, saved view, and all that the tab Layers shows, hides or "
    "colours is a step: all browsers see it, anybody can undo it, and it is saved at once. The frame that is shown, "
    "playing and the selected pair are the same in all browsers but no steps. Where a browser looks from, its tool, "
    "cuts and way to compare pictures are its own; the choice for colour-blind eyes is kept for this computer."
)
"""The same for people."""

FIELDS: Mapping[str, Kind] = {
    "annotation": Kind.DECISION,
    "past": Kind.HISTORY,
    "future": Kind.HISTORY,
    "stroke": Kind.HISTORY,
    "recording": Kind.PLACE,
    "frame": Kind.PLACE,
    "selected_key": Kind.PLACE,
    "is_playing": Kind.PLACE,
    "speed": Kind.PLACE,
    "are_colors_safe": Kind.SETTING,
    "recordings": Kind.NEWS,
    "live_asked": Kind.NEWS,
    "fit_note": Kind.NEWS,
    "job": Kind.NEWS,
    "waiting_jobs": Kind.NEWS,
    "ended_jobs": Kind.NEWS,
    "offered_jobs": Kind.NEWS,
    "suggested": Kind.NEWS,
    "jobs_started": Kind.NEWS,
    "people": Kind.NEWS,
    "notice": Kind.NEWS,
    "data_revision": Kind.NEWS,
    "renderer_note": Kind.NEWS,
}
"""Of `AppState`, each field."""

ACTIONS: Mapping[type, Kind] = {
    **dict.fromkeys((picks.PickPoint, picks.MovePoint, picks.PickSighting), Kind.DECISION),
    **dict.fromkeys((pairs.RenamePair, pairs.EnablePair, pairs.DeletePair, files.ImportKeypoints), Kind.DECISION),
    **dict.fromkeys((choices.ChooseAlignment, choices.ChooseMethod, choices.CompareMethod), Kind.DECISION),
    **dict.fromkeys((live.FollowKeypoints, live.FitFound, views.CompareWith), Kind.DECISION),
    **dict.fromkeys((marks.MarkFrame, marks.NoteFrame), Kind.DECISION),
    **dict.fromkeys((places.SaveView, places.RenameView, places.RemoveView), Kind.DECISION),
    **dict.fromkeys((views.ShowLayer, views.TintLayer, views.ThinCameras, views.ColorCameras), Kind.DECISION),
    **dict.fromkeys((views.DrawTags, ShowSuggestions), Kind.DECISION),
    jobs.JobEnded: Kind.DECISION,  # where it suggests an alignment
    **dict.fromkeys((history.Undo, history.Redo, history.GoToStep), Kind.HISTORY),
    **dict.fromkeys((choices.OpenRecording, views.ShowFrame, views.StepFrame, views.BeginAt), Kind.PLACE),
    **dict.fromkeys((playing.Play, playing.TogglePlay, playing.SetSpeed, playing.PlayOn), Kind.PLACE),
    pairs.SelectPair: Kind.PLACE,
    views.UseSafeColors: Kind.SETTING,
    **dict.fromkeys((Notify, views.NameRenderer, views.ScanPrepared), Kind.NEWS),
    **dict.fromkeys((jobs.StartJob, jobs.JobProgressed, jobs.CancelJob), Kind.NEWS),
    **dict.fromkeys((jobs.OfferJobs, jobs.ResumeJobs, jobs.DismissJobs), Kind.NEWS),
    **dict.fromkeys((people.PersonCame, people.PersonLeft), Kind.NEWS),
}
"""Of actions/, each class."""
