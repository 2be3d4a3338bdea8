"""Lives of the app that end by kill -9 while two browsers work: what was shown must be there in the next life.

Each life is forked from a process that has imported everything and done nothing else. It says `started D` with the
digest D of its history, `wanted D` before a state is saved, and `shown D` once all views have rendered it. After the
kill, the next life must start with the last that was shown, or one that was wanted after it: saved, but not shown yet.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import multiprocessing
import os
import random
import signal
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from gazeloc_app.actions.action import Action
from gazeloc_app.actions.choices import ChooseAlignment, ChooseMethod
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.actions.places import RemoveView, SaveView
from gazeloc_app.actions.views import ColorCameras, CompareWith, ShowLayer, ThinCameras, TintLayer
from gazeloc_app.annotation.annotation_json import changes_to_json
from gazeloc_app.annotation.history import History
from gazeloc_app.annotation.project_files import annotation_in_files
from gazeloc_app.annotation.room_saving import RoomSaver
from gazeloc_app.annotation.saving import IN_THE_JOURNAL, Saver
from gazeloc_app.app import App
from gazeloc_app.state import ABOUT_THE_ROOM, Annotation, AppState, Coloring, Layer
from viser import _messages

from gazeloc_core.methods import Method
from gazeloc_core.project import Project
from gazeloc_core.surfaces.saved_views import SavedView

BROWSERS = (7, 8)
LIFE_S = 60.0


@dataclass
class Outcome:
    """What all lives came to."""

    kills: int = 0
    actions: int = 0
    """What people did, whether it was shown or not."""
    shown: int = 0
    """Actions that views had rendered."""
    lost: list[str] = field(default_factory=list)
    """What went wrong, a sentence each."""
    steps: int = 0
    """Steps in the history at the end."""


def live_and_die(folder: Path, *, kills: int, actions: int, seed: int = 0) -> Outcome:
    """Kill the app `kills` times during `actions` random actions or more; the project must not be open elsewhere."""
    rng, outcome = random.Random(seed), Outcome()
    allowed: set[str] | None = None
    for life in range(kills):
        until = max(2, round(rng.uniform(0.5, 1.5) * actions / kills))
        if life == kills - 1:
            until = max(until, actions - outcome.shown)
        started, shown, allowed_next = _one_life(folder, rng.randrange(2**31), until, rng.uniform(0, 0.02))
        if started is None:
            outcome.lost.append(f"life {life}: the app did not start")
            return outcome
        if allowed is not None and started not in allowed:
            outcome.lost.append(f"life {life}: it started with a history that was not the last one shown")
        outcome.kills, outcome.shown = outcome.kills + 1, outcome.shown + shown
        allowed = allowed_next
    check_end(folder, outcome, allowed or set())
    return outcome


def check_end(folder: Path, outcome: Outcome, allowed: set[str] | None = None) -> None:
    """Compare the project's files with the history that they hold at the end, and this with those that it may be."""
    project = Project.open(folder)
    with project.lock():
        saver = Saver(project)
        history = saver.open("walk")
        if allowed is not None and Digests()(history) not in allowed:
            outcome.lost.append("the history at the end is not the last one shown")
        state = history.put_into(AppState(("walk",), "walk"))
        room = saver.room_after_a_kill(RoomSaver(folder).read())
        saver.commit(state, state)
        saver.settle(state, state)
        elsewhere = {name: getattr(room, name) for name in ABOUT_THE_ROOM}
        elsewhere |= {name: getattr(history.present, name) for name in IN_THE_JOURNAL}
        in_files = replace(annotation_in_files(project, "walk"), **elsewhere)
        if in_files != history.present:
            outcome.lost.append("the project's files differ from the history")
    outcome.steps = len(history.annotations)


def _one_life(folder: Path, seed: int, until: int, delay_s: float) -> tuple[str | None, int, set[str]]:
    """The digest at its start, how many actions were shown, and the digests with which the next life may start."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["crash_life"])
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_live, args=(folder, seed, theirs), daemon=True)
    process.start()
    theirs.close()
    lines: list[str] = []
    with suppress(EOFError):
        while _actions(lines) < until and ours.poll(LIFE_S):
            lines.append(ours.recv_bytes().decode())
    time.sleep(delay_s)
    assert process.pid is not None
    os.kill(process.pid, signal.SIGKILL)
    process.join()
    with suppress(EOFError, OSError):  # what it said between our last look and its end
        while True:
            lines.append(ours.recv_bytes().decode())
    said_of = [(line.split()[0], line.split()[1]) for line in lines]
    started = next((digest for kind, digest in said_of if kind == "started"), None)
    acknowledged = [i for i, (kind, _) in enumerate(said_of) if kind in ("shown", "started")]
    after = said_of[acknowledged[-1] :] if acknowledged else []
    return started, _actions(lines), {digest for _, digest in after}


def _actions(lines: list[str]) -> int:
    """How many actions were applied in the states that were shown."""
    return max((int(line.split()[2]) for line in lines if line.startswith("shown")), default=0)


class Digests:
    """Names histories by their content; remembers the parts."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[Annotation, str]] = {}

    def __call__(self, history: History) -> str:
        parts = [self._of(annotation) for annotation in history.annotations]
        return hashlib.sha256(json.dumps([parts, history.position]).encode()).hexdigest()[:16]

    def _of(self, annotation: Annotation) -> str:
        known = self._known.get(id(annotation))
        if known is None:
            content = json.dumps(changes_to_json(Annotation(), annotation))  # the order of sets differs by process
            digest = hashlib.sha256(content.encode()).hexdigest()
            known = self._known[id(annotation)] = (annotation, digest)
        return known[1]


def _live(folder: Path, seed: int, pipe: Connection) -> None:
    app, digests = App(Project.open(folder), port=0), Digests()

    def say(kind: str, state: AppState) -> None:
        pipe.send_bytes(f"{kind} {digests(History.of(state))} {app.store.applied}".encode())

    app.store._savers.insert(0, lambda before, after: say("wanted", after))
    app.store.add_view(lambda state: say("shown", state))
    say("started", app.store.state)
    app.store.start()
    app.server.gui._resolve_client = lambda client_id: SimpleNamespace(client_id=client_id)  # type: ignore[method-assign, assignment, return-value]
    threads = [threading.Thread(target=_browse, args=(app, seed + which, which)) for which in BROWSERS]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _browse(app: App, seed: int, client_id: int) -> None:
    """Work like one person: clicks in the scene, and the widgets of the panels by the messages that a page sends."""
    rng = random.Random(seed)
    for _ in range(100_000):
        kind = rng.random()
        if kind < 0.4:
            point = (rng.uniform(0, 4), rng.uniform(0, 3), rng.uniform(0, 2.6))
            app.store.dispatch(PickPoint(rng.choice(list(Side)), point, move=rng.random() < 0.2))
        elif kind < 0.5:
            app.store.dispatch(ChooseAlignment(rng.choice([None, "a", "b"])))
        elif kind < 0.55:
            app.store.dispatch(ChooseMethod(rng.choice(list(Method))))
        elif kind < 0.65:
            app.store.dispatch(_about_the_room(rng))
        else:
            _use_widget(app, rng, client_id)
        time.sleep(rng.uniform(0.0, 0.03))


def _about_the_room(rng: random.Random) -> Action:
    name = f"view {rng.randrange(4)}"
    view = SavedView(name, (rng.uniform(0, 4), 1.0, 1.5), (2.0, 1.0, 1.0))
    color = (rng.randrange(256), 80, 200)
    shown = [ShowLayer(rng.choice(list(Layer)), rng.random() < 0.5), ColorCameras(rng.choice(list(Coloring)))]
    shown += [ThinCameras(rng.choice([None, 1, 5])), CompareWith(rng.choice(["", "tags"]))]
    tinted = TintLayer(Layer.SCAN, rng.choice([None, color]))
    return rng.choice([SaveView(view), RemoveView(name), tinted, rng.choice(shown)])


def _use_widget(app: App, rng: random.Random, client_id: int) -> None:
    choices: list[tuple[str, Any]] = [
        ("Undo the last step", True),
        ("Redo", True),
        ("Name", f"spot {rng.randrange(1000)}"),
        ("Counts", rng.random() < 0.5),
        ("Delete the pair", True),
    ]
    label, value = rng.choice(choices)
    gui = app.server.gui
    handle = next(one for one in list(gui._gui_input_handle_from_uuid.values()) if getattr(one, "label", "") == label)
    message = _messages.GuiUpdateMessage(handle._impl.uuid, {"value": value})
    loop = app.server.get_event_loop()
    asyncio.run_coroutine_threadsafe(gui._handle_gui_updates(client_id, message), loop).result(10)  # type: ignore[arg-type]
