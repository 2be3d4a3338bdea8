"""Two real pages at work on an app that is killed by kill -9 at random moments, and started again.

Acknowledged is what a page has shown: the rows of its tab History, and the keypoints in its scene, as a script in the
page reads them from the DOM and from the scene. The app writes every state to a file of the test before it saves it
(`wanted`), and what it began with (`started`). After a kill:

- the app must start with a state that was wanted, and that is no earlier than the last one that either page showed;
- both pages must come back by themselves, and show just that.

A busy page may draw the keypoints of one step in more than one go. What it shows in between is no state, and says of
each keypoint that it shows, and of nothing else, that it is saved.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from crash_life import Outcome, check_end
from gazeloc_app.actions.marks import MarkFrame
from gazeloc_app.annotation.history import History
from gazeloc_app.annotation.saving import Saver
from gazeloc_app.annotation.steps import describe
from gazeloc_app.app import App
from gazeloc_app.state import Annotation, AppState
from playwright.sync_api import Browser, Error, Page

from gazeloc_core.frames.marks import Mark
from gazeloc_core.project import Project

SIZE = {"width": 1260, "height": 640}
BACK_S = 60.0
"""So long a page may take to come back by itself on a busy machine."""
START_S = 300.0
_RECORD = """
(() => {
  let last = '', told = '';
  const read = () => {
    const nodes = (window.__viserMutable || {}).nodeRefFromName || {};
    const places = {};
    for (const [name, node] of Object.entries(nodes)) {
      const found = name.match(/^\\/keypoints\\/([^/]+)\\/scan$/);
      if (found && node) places[found[1]] = node.position.toArray();
    }
    const rows = Array.from(document.querySelectorAll('.gazeloc-step'), (row) => [
      Number(row.querySelector('span').textContent),
      row.textContent.slice(row.querySelector('span').textContent.length).trim(),
      row.classList.contains('gazeloc-now') ? 'now' : row.classList.contains('gazeloc-undone') ? 'undone' : 'done',
    ]);
    return { rows, places };
  };
  setInterval(() => {
    const value = read();
    const text = JSON.stringify(value);
    const isPlaced = Object.values(value.places).every((place) => place.some(Boolean)); // not new and without a place
    if (value.rows.length && isPlaced && text === last && text !== told) {
      told = text;
      window.tellTest(JSON.stringify({ ...value, loaded: performance.timeOrigin }));
    }
    last = text;
  }, 50);
})()
"""


@dataclass
class _Shown:
    """What a page said that it shows, in order; `loaded` is when the page was loaded, in milliseconds."""

    page: Page
    said: list[dict[str, Any]] = field(default_factory=list)

    def since(self, loaded_ms: float) -> list[dict[str, Any]]:
        return [one for one in self.said if one["loaded"] >= loaded_ms]


def work_and_die(browser: Browser, folder: Path, *, kills: int, actions: int, seed: int = 0) -> Outcome:
    """Kill the app `kills` times during `actions` actions of two pages or more; both keep to their own profile."""
    rng, outcome = random.Random(seed), Outcome()
    _take_a_step(folder)
    port, life = _free_port(), 0
    process, log = _begin(folder, port, life)
    pages = [_open(browser, port) for _ in range(2)]
    try:
        _wait_until_shown(pages, _entries(log)[0], 0.0)
        for life in range(1, kills + 1):
            quota = max(2, round(rng.uniform(0.5, 1.5) * actions / kills))
            if life == kills:
                quota = max(quota, actions - outcome.actions)
            outcome.actions += _work(pages, rng, quota, process)
            loaded_ms = 1000 * time.time()
            allowed = _allowed(_entries(log), pages, outcome, f"life {life}")
            process, log = _begin(folder, port, life)
            started = _entries(log)[0]
            outcome.kills, outcome.shown = outcome.kills + 1, outcome.shown + sum(len(one.said) for one in pages)
            if started["state"] not in allowed:
                outcome.lost.append(f"life {life}: the app began with less than a page had shown")
            for number in _wait_until_shown(pages, started, loaded_ms):
                outcome.lost.append(f"life {life}: page {number} did not come back to what the app has")
    finally:
        for one in pages:
            one.page.context.close()
        _kill(process)
    check_end(folder, outcome)
    return outcome


def _take_a_step(folder: Path) -> None:
    """So that the tab History has rows from the beginning."""
    project = Project.open(folder)
    with project.lock():
        saver = Saver(project)
        before = saver.open("walk").put_into(AppState(("walk",), "walk"))
        after = MarkFrame(Mark.GOOD).apply(before)
        saver.commit(before, after)
        saver.settle(before, after)


def _work(pages: list[_Shown], rng: random.Random, quota: int, process: BaseProcess) -> int:
    """Actions of both pages in turns until the app is dead; how many were made before."""
    for one in pages:
        one.said.clear()
    done = 0
    killer: threading.Timer | None = None
    while process.is_alive():
        if done >= quota and killer is None:
            killer = threading.Timer(rng.uniform(0, 0.4), _kill, (process,))
            killer.start()
        _act(rng.choice(pages).page, rng)
        done += process.is_alive()
    return done


def _act(page: Page, rng: random.Random) -> None:
    """One thing that a person does, by mouse or keys."""
    kind = rng.random()
    with suppress(Error):  # a button that is disabled, a page that is just being loaded again
        if kind < 0.4:
            page.keyboard.down("Shift")
            page.mouse.click(rng.randrange(480, 800), rng.randrange(160, 560))
            page.keyboard.up("Shift")
        elif kind < 0.6:
            page.keyboard.press(rng.choice("lj"))
            page.keyboard.press(rng.choice("gbu"))
        elif kind < 0.75:
            page.get_by_role("button", name="Undo the last step", exact=True).click(timeout=500)
        elif kind < 0.85:
            page.keyboard.press(rng.choice(["Control+z", "Control+Shift+z"]))
        else:
            rows = page.locator(".gazeloc-step")
            rows.nth(rng.randrange(min(rows.count(), 12))).click(timeout=500)
        page.wait_for_timeout(rng.uniform(0, 120))


def _allowed(entries: list[dict[str, Any]], pages: list[_Shown], outcome: Outcome, life: str) -> list[Any]:
    """The states with which the next life may begin: from the last one that a page showed on."""
    last = 0
    for number, one in enumerate(pages):
        for part, first in (("rows", _first_rows), ("places", _first_places)):
            place = 0
            for said in one.said:
                found = first(entries, place, said[part])
                if found is None:
                    outcome.lost.append(f"{life}: page {number} showed {part} that were never saved: {said[part]}")
                else:
                    place = found
            last = max(last, place)
    return [entry["state"] for entry in entries[last:]]


def _first_rows(entries: list[dict[str, Any]], start: int, said: Any) -> int | None:
    return _first(entries, start, lambda state: _same_rows(said, state["rows"]))


def _first_places(entries: list[dict[str, Any]], start: int, said: Any) -> int | None:
    """The first state with these keypoints and no other; where none is, the first by which each of them was there."""
    whole = _first(entries, start, lambda state: _same_places(said, state["places"]))
    if whole is not None:
        return whole
    each = [
        _first(entries, start, lambda state, key=key: _same_places({key: said[key]}, _only(key, state)))  # type: ignore[misc]
        for key in said
    ]
    return None if None in each else max((number for number in each if number is not None), default=start)


def _only(key: str, state: Any) -> dict[str, Any]:
    return {key: state["places"][key]} if key in state["places"] else {}


def _first(entries: list[dict[str, Any]], start: int, is_it: Callable[[Any], bool]) -> int | None:
    wanted = enumerate(entries[start:], start)
    return next((number for number, entry in wanted if is_it(entry["state"])), None)


def _same_rows(said: Any, wanted: Any) -> bool:
    """The page lists some sixty steps around the one in force; every one must be as the app has it."""
    return len(said) >= min(len(wanted), 30) and all(row[0] < len(wanted) and row == wanted[row[0]] for row in said)


def _same_places(said: Any, wanted: Any) -> bool:
    return said.keys() == wanted.keys() and all(
        abs(a - b) < 1e-4 for key in wanted for a, b in zip(said[key], wanted[key], strict=True)
    )


def _wait_until_shown(pages: list[_Shown], entry: dict[str, Any], loaded_ms: float) -> Iterator[int]:
    """Numbers of the pages that do not show a state in time, each loaded since."""
    end = time.monotonic() + BACK_S
    late = []
    for number, one in enumerate(pages):
        while not _shows(one.since(loaded_ms), entry["state"]):
            if time.monotonic() > end:
                late.append(number)
                break
            one.page.wait_for_timeout(50)
    return iter(late)


def _shows(said: list[dict[str, Any]], state: Any) -> bool:
    return (
        bool(said) and _same_rows(said[-1]["rows"], state["rows"]) and _same_places(said[-1]["places"], state["places"])
    )


def _open(browser: Browser, port: int) -> _Shown:
    page = browser.new_context(viewport=SIZE, device_scale_factor=1).new_page()
    shown = _Shown(page)
    page.expose_function("tellTest", lambda text: shown.said.append(json.loads(text)))
    page.add_init_script(_RECORD)
    page.goto(f"http://127.0.0.1:{port}/?fixedDpr=1")
    page.get_by_role("tab", name="History", exact=True).click(timeout=60_000)
    return shown


def _begin(folder: Path, port: int, life: int) -> tuple[BaseProcess, Path]:
    """A life of the app, forked from a process that has imported everything; returns once it has opened the project."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["crash_pages"])
    log = folder.parent / f"life-{life}.jsonl"
    log.unlink(missing_ok=True)
    process = context.Process(target=_live, args=(folder, port, log))
    process.start()
    end = time.monotonic() + START_S
    while not (log.exists() and _entries(log)):
        assert process.is_alive(), "the app did not start"
        assert time.monotonic() < end, "the app does not start"
        time.sleep(0.05)
    return process, log


def _live(folder: Path, port: int, log: Path) -> None:
    app = App(Project.open(folder), port=port)
    steps = _Steps()
    with log.open("a", buffering=1, encoding="utf-8") as file:

        def write(kind: str, state: AppState) -> None:
            file.write(json.dumps({"kind": kind, "state": steps.of(state)}) + "\n")

        app.store._savers.insert(0, lambda before, after: write("wanted", after))
        write("started", app.store.state)
        app.start()
        threading.Event().wait()


class _Steps:
    """What pages have to show of states; remembers the sentences."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int], tuple[Annotation, Annotation, str]] = {}

    def of(self, state: AppState) -> dict[str, Any]:
        history = History.of(state)
        rows = []
        for step in range(len(history.annotations)):
            text = self._sentence(history.annotations[step - 1], history.annotations[step]) if step else "The beginning"
            kind = "now" if step == history.position else "undone" if step > history.position else "done"
            rows.append([step, text, kind])
        places = {pair.key: list(pair.scan) for pair in state.annotation.keypoints if pair.scan is not None}
        return {"rows": rows, "places": places}

    def _sentence(self, before: Annotation, after: Annotation) -> str:
        key = (id(before), id(after))
        if key not in self._known:
            self._known[key] = (before, after, describe(before, after))
        return self._known[key][2]


def _entries(log: Path) -> list[dict[str, Any]]:
    """The whole lines of a log; the last one may have been cut off by the kill."""
    text = log.read_text(encoding="utf-8")
    return [json.loads(line) for line in text[: text.rfind("\n") + 1].splitlines()]


def _kill(process: BaseProcess) -> None:
    if process.pid is not None and process.is_alive():
        os.kill(process.pid, signal.SIGKILL)
        process.join()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
