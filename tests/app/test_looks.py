"""What the app says about itself: hints on everything that can be pressed, keys, first steps, light and dark."""

import asyncio
import gc
import re
import shutil
import time
from dataclasses import replace
from unittest.mock import MagicMock

import pytest
from app_project import make_app_project
from app_steps import step, stop
from gazeloc_app import looks
from gazeloc_app.actions.history import Undo
from gazeloc_app.actions.jobs import CancelJob, JobEnded, StartJob
from gazeloc_app.actions.pairs import SelectPair
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.app import App
from gazeloc_app.data import ProjectData
from gazeloc_app.looks import Look
from gazeloc_app.panels.first_steps import FirstSteps
from gazeloc_app.panels.help import WORDS, HelpPanel, commands_of
from gazeloc_app.state import AppState, Level
from gazeloc_app.work import tasks
from viser import GuiHtmlHandle, ViserServer
from viser._messages import GuiSetPanelCollapsedMessage, GuiSetPanelWidthMessage
from visitor import CAMERA, get, page, until


@pytest.fixture(scope="module")
def app(tmp_path_factory):
    app = App(make_app_project(tmp_path_factory.mktemp("project")), port=0)
    app.store._render()
    yield app
    stop(app)


def while_connected(app, look):
    """What `look(client)` says of a connected browser."""

    async def talk():
        async with page(app.server.get_port()) as visitor:
            known = set(app.browsers)
            await visitor.send(CAMERA)
            await until(lambda: set(app.browsers) - known)
            (client_id,) = set(app.browsers) - known
            return look(app.server.get_clients()[client_id])

    return asyncio.run(talk())


def without_hint(gui):
    handles = gui._gui_input_handle_from_uuid.values()
    return [getattr(handle, "label", "?") for handle in handles if not (getattr(handle, "hint", "x") or "").strip()]


def test_everything_that_can_be_pressed_or_set_says_what_it_does(app):
    assert len(app.server.gui._gui_input_handle_from_uuid) > 20
    assert without_hint(app.server.gui) == []


def test_so_does_what_belongs_to_one_browser(app):
    assert while_connected(app, lambda client: without_hint(client.gui)) == []


def test_so_does_what_is_in_our_own_html(app, monkeypatch):
    monkeypatch.setattr(app.jobs, "start", lambda *_, **__: None)
    walk = (("recording", "walk"),)
    jobs = (StartJob("Align", tasks.align, walk), StartJob("Draw the figures", tasks.draw_figures, walk))
    step(app, *jobs, PickPoint(Side.SCAN, (1, 2, 0.5)))

    def look(client):
        while client.client_id not in [person.client_id for person in app.store.state.people]:
            time.sleep(0.02)
            app.store.step()
        return [handle.content for handle in gc.get_objects() if isinstance(handle, GuiHtmlHandle)]

    shown = "".join(while_connected(app, look))
    found = re.findall(r"<(?:button|input|select)\b[^>]*>", shown)
    kinds = ("gazeloc-step", "gazeloc-small", "Your name")
    assert [kind for kind in kinds if not any(kind in tag for tag in found)] == []
    labelled = {f'id="{name}"' for name in re.findall(r'<label for="([^"]+)"', shown)}
    silent = [tag for tag in found if not re.search(r'(title|aria-label)="[^"]+"', tag)]
    assert [tag for tag in silent if not any(name in tag for name in labelled)] == []
    step(app, *(CancelJob(number) for number in (1, 2)), JobEnded(Level.INFO, "done"), Undo())


def test_moving_a_point_is_offered_while_a_pair_is_selected(app):
    def look(client):
        browser, offered = app.browsers[client.client_id], []
        for action in (SelectPair(None), PickPoint(Side.SCAN, (1, 2, 0.5)), Undo()):
            step(app, action)
            browser.render(app.store.state)
            offered.append(browser._move.visible)
        return offered

    assert while_connected(app, look) == [False, True, False]


def test_every_command_is_in_the_help_with_its_key(app):
    def look(client):
        return [*commands_of(app.server.gui), *commands_of(client.gui)], app.panels.of(HelpPanel)._keys.content

    commands, text = while_connected(app, look)
    assert ("Ctrl Z", "Undo") in [(key, name.partition(":")[0]) for key, name in commands]
    for key, name in commands:
        assert f"<kbd>{key}</kbd>" in text
        assert name.replace("&", "&amp;").replace("'", "&#x27;") in text
    for word, _ in WORDS:
        assert f"<i>{word}</i>" in text


def test_no_key_does_two_things(app):
    commands = while_connected(app, lambda client: [*commands_of(app.server.gui), *commands_of(client.gui)])
    keys = [key for key, _ in commands if key != "–"]
    assert len(keys) == len(set(keys))


def test_viser_still_keeps_commands_where_the_help_looks_for_them():
    server = ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        server.gui.add_command("Do it", hotkey="K", modifier="cmd/ctrl+shift", description="at once")
        server.gui.add_command("Or not")
        assert commands_of(server.gui) == [("Ctrl Shift K", "Do it: at once"), ("–", "Or not")]
    finally:
        server.stop()


def test_the_first_steps_say_what_comes_next(app):
    def card():
        return app.panels.of(FirstSteps)._card

    assert "Align.</b>" in card().content
    assert "✓ Process" in card().content
    step(app, PickPoint(Side.SCAN, (1, 2, 0.5)))
    assert "1 of 3 keypoints" in card().content


class TestTheFirstStepFitsTheProject:
    """One empty project of each kind: what its card says to do first."""

    def card(self, project, *actions):
        panel, state = FirstSteps(MagicMock(), ProjectData(project)), AppState(("walk",), "walk")
        for action in actions:
            state = action.apply(state)
        panel.render(state)
        return panel._card.content

    def without_stages(self, project, **changes):
        shutil.rmtree(project.folder / "recordings")
        project.save(replace(project.settings, **changes))
        return project

    def test_nothing_was_run(self, tmp_path):
        card = self.card(self.without_stages(make_app_project(tmp_path)))
        assert "Process.</b> Press “Run everything” below: it finds the cameras from the frames" in card

    def test_a_run_that_is_under_way_is_not_asked_for(self, tmp_path):
        start = StartJob("Run everything", tasks.run_all, (("recording", "walk"),))
        card = self.card(self.without_stages(make_app_project(tmp_path)), start)
        assert "Process.</b> “Run everything” is at work, see the top right." in card
        assert "Press" not in card

    def test_with_a_model_of_colmap(self, tmp_path):
        project = make_app_project(tmp_path)
        walk = replace(project.recording("walk"), colmap=tmp_path)
        assert "takes the cameras of your COLMAP model" in self.card(
            self.without_stages(project, recordings={"walk": walk})
        )

    def test_without_tags(self, tmp_path):
        card = self.card(make_app_project(tmp_path, tags=False))
        assert "Align.</b> This project names no tags: set three keypoints" in card

    def test_with_a_bare_mesh(self, tmp_path):
        card = self.card(make_app_project(tmp_path))
        assert "Align.</b> The scan has no pictures of a phone, so no tag is known on it: set three keypoints" in card


def test_the_logo_and_the_icon_are_there(app):
    for name in ("logo-light.svg", "logo-dark.svg", "favicon.svg"):
        status, headers, body = get(app.server.get_port(), f"/static/{name}")
        assert (status, headers["Content-Type"]) == (200, "image/svg+xml")
        assert b"<svg" in body
    text = get(app.server.get_port())[2].decode()
    assert 'href="/static/favicon.svg"' in text
    assert text.index("--gazeloc-good") < text.index("</head>")


def look_of(stored):
    client = MagicMock()
    if isinstance(stored, Exception):
        client.local_storage.get_item.side_effect = stored
    else:
        client.local_storage.get_item.return_value = stored
    return Look(client, ()), client


@pytest.mark.parametrize("stored", [None, "light", "purple", "<script>", RuntimeError("gone"), TimeoutError("slow")])
def test_a_browser_that_says_nothing_of_the_dark_is_light(stored):
    look, client = look_of(stored)
    asyncio.run(look._remember())
    client.gui.configure_theme.assert_not_called()


def test_the_dark_is_remembered_by_the_browser():
    look, client = look_of("dark")
    asyncio.run(look._remember())
    assert client.gui.configure_theme.call_args.kwargs["dark_mode"] is True
    look.toggle()
    assert client.gui.configure_theme.call_args.kwargs["dark_mode"] is False
    client.local_storage.set_item.assert_called_with("gazeloc-look", "light")


@pytest.mark.parametrize(
    ("widths_px", "panels", "folds"),
    [((120, 120, 120), 2, 1), ((300, 125, 128), 2, 1), ((190, 190, 384), 2, 0), ((700, 450, 450), 0, 0)],
)
def test_a_tablets_panels_are_narrower_once_and_upright_one_is_folded_up(app, monkeypatch, widths_px, panels, folds):
    set_to, folded = [], []
    monkeypatch.setattr(looks, "fold_panel", lambda client, panel: folded.append(panel))
    monkeypatch.setattr(looks, "set_panel_width", lambda client, panel, width: set_to.append((panel, width)))

    async def talk():
        async with page(app.server.get_port()) as visitor:
            known = set(app.browsers)
            await visitor.send(CAMERA)
            await until(lambda: set(app.browsers) - known)
            for fov, width_px in zip((0.81, 0.82, 0.83), widths_px, strict=True):
                await visitor.send(CAMERA | {"image_width": width_px, "fov": fov})
            await until(lambda: any(c.camera.fov == 0.83 for c in app.server.get_clients().values()))
            await asyncio.sleep(0.1)

    asyncio.run(talk())
    assert [width for _, width in set_to] == [looks.TABLET_PANEL_PX] * panels
    assert folded == [app.panels.handles[1]] * folds


def test_viser_takes_a_panels_width_for_one_browser(app):
    def look(client):
        sent = []
        client.gui._websock_interface.queue_message = sent.append
        looks.set_panel_width(client, app.server.gui.main_panel, 300)
        looks.fold_panel(client, app.panels.handles[1])
        kinds = (GuiSetPanelWidthMessage, GuiSetPanelCollapsedMessage)
        return [one for one in sent if isinstance(one, kinds)]  # others may be under way

    message, fold = while_connected(app, look)
    assert (fold.collapsed, fold.uuid) == (True, app.panels.handles[1]._placement_uuid)
    assert (message.width, message.uuid) == (300, app.server.gui.main_panel._placement_uuid)
