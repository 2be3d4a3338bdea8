"""Pictures by URL: who pushes whose picture aside, and what is drawn first."""

import asyncio
import threading
import time

import pytest
from gazeloc_app.drawing.pictures import QUICK_PX, WIDTH_PX, Pictures, render_url
from gazeloc_app.drawing.render_process import RenderProcess, Superseded

from gazeloc_core.errors import InputError
from gazeloc_core.stages.registration import align_keypoints


def test_pages_that_ask_for_the_same_frame_share_it_and_others_do_not_push_it_aside(app, monkeypatch):
    gate, asked = threading.Event(), []

    def slowly(self, job):
        gate.wait(10)
        asked.append(job.index)
        return str(job.index).encode()

    monkeypatch.setattr(RenderProcess, "_answer", slowly)
    process = RenderProcess(None)
    pictures = Pictures(app.data, process)

    async def browse():
        first = asyncio.create_task(pictures.frame("walk", 0, {"page": "a"}))
        await asyncio.sleep(0.05)
        both = [asyncio.create_task(pictures.frame("walk", 6, {"page": page})) for page in "ab"]
        late = [asyncio.create_task(pictures.frame("walk", index, {"page": "c"})) for index in (3, 4)]
        await asyncio.sleep(0.05)
        gate.set()
        return await asyncio.gather(first, *both, *late, return_exceptions=True)

    answers = asyncio.run(browse())
    process.close()
    assert answers[:3] == [b"0", b"6", b"6"]
    assert isinstance(answers[3], Superseded)
    assert asked == [0, 6, 4]


def test_small_pictures_for_lists_come_after_the_frame_that_is_shown(app, monkeypatch):
    gate, asked = threading.Event(), []

    def slowly(self, job):
        gate.wait(10)
        asked.append(job.index)
        return b""

    monkeypatch.setattr(RenderProcess, "_answer", slowly)
    process = RenderProcess(None)
    pictures = Pictures(app.data, process)

    async def browse():
        small = [asyncio.create_task(pictures.thumbnail("walk", index, {})) for index in (5, 7, 9)]
        await asyncio.sleep(0.05)
        shown = asyncio.create_task(pictures.frame("walk", app.store.state.frame, {}))
        await asyncio.sleep(0.05)
        gate.set()
        await asyncio.gather(shown, *small)

    asyncio.run(browse())
    process.close()
    assert asked == [5, app.store.state.frame, 7, 9]


def test_quick_pictures_come_before_those_in_full_and_neighbours_last(app, monkeypatch):
    gate, asked = threading.Event(), []

    def slowly(self, job):
        gate.wait(10)
        asked.append((job.index, job.width))
        return b""

    monkeypatch.setattr(RenderProcess, "_answer", slowly)
    process = RenderProcess(None)
    pictures = Pictures(app.data, process)

    async def browse():
        asks = [(0, {}), (5, {"ahead": "1"}), (6, {}), (7, {"quick": "1"})]
        tasks = []
        for index, query in asks:
            tasks.append(asyncio.create_task(pictures.frame("walk", index, query)))
            await asyncio.sleep(0.05)
        gate.set()
        await asyncio.gather(*tasks)

    asyncio.run(browse())
    process.close()
    assert asked == [(0, WIDTH_PX), (7, QUICK_PX), (6, WIDTH_PX), (5, WIDTH_PX)]


def test_a_page_that_gives_itself_a_strange_name_gets_no_picture(app):
    with pytest.raises(InputError, match="letters and digits"):
        asyncio.run(Pictures(app.data, None).frame("walk", 1, {"page": "a/b"}))


def test_poses_that_are_long_in_coming_hold_the_page_up_and_not_the_loop_and_the_last_wish_counts(app, monkeypatch):
    key = align_keypoints(app.project, "walk").key
    app.data.trajectory("walk", key)
    drawn, plain, asked = [], app.data.trajectory, []

    def slow_at_first(recording, key):
        asked.append(key)
        if len(asked) == 1:
            time.sleep(0.3)
        return plain(recording, key)

    monkeypatch.setattr(app.data, "trajectory", slow_at_first)
    monkeypatch.setattr(RenderProcess, "_answer", lambda self, job: drawn.append(job) or repr(job.center).encode())
    process = RenderProcess(None)
    pictures = Pictures(app.data, process)

    async def browse():
        both = [asyncio.create_task(pictures.render("walk", frame, {"rev": key, "page": "a"})) for frame in (3, 5)]
        naps = 0
        while len(drawn) == 0:
            await asyncio.sleep(0.01)
            naps += 1
        return naps, await asyncio.gather(*both, return_exceptions=True)

    naps, answers = asyncio.run(browse())
    process.close()
    assert naps > 5
    assert answers[1] == repr(drawn[-1].center).encode()


def test_a_scan_that_got_colours_has_other_renders(app):
    before = render_url(app.data, "walk", "abc", 3)
    assert before.startswith("/renders/walk/3.jpg?rev=abc&")
    assert render_url(app.data, "walk", "abc", 3) == before
    app.project.scan_artifact("colors").write_arrays({}, options={}, inputs={})
    assert render_url(app.data, "walk", "abc", 3) != before
