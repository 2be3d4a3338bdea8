"""Hostile people: what a page says about itself reaches the others as text, cut short, and speaks for it alone."""

import asyncio
import re
from urllib.parse import quote

import pytest
from app_project import make_app_project
from app_steps import step, stop
from gazeloc_app.actions.people import MAX_NAME
from gazeloc_app.app import App
from visitor import CAMERA, get, page, until

SCRIPT = "<img src=x onerror=alert(1)>'\"><script>"
TAB = "a" * 24


@pytest.fixture(scope="module")
def app(tmp_path_factory):
    app = App(make_app_project(tmp_path_factory.mktemp("project")), port=0)
    app.store._render()
    yield app
    stop(app)


def with_two_pages(app, look):
    """What `look(secrets, visits)` says while two pages are open."""

    def people():
        step(app)
        return len(app.store.state.people)

    async def talk():
        await until(lambda: people() == 0)  # those of the test before have gone
        async with page(app.server.get_port()) as first, page(app.server.get_port()) as second:
            for visitor in (first, second):
                await visitor.send(CAMERA)
            await until(lambda: people() == 2 == len(app._visitors._visits))
            return await asyncio.to_thread(look, *zip(*app._visitors._visits.items(), strict=True))

    return asyncio.run(talk())


def ask(app, secret, what):
    status, _, body = get(app.server.get_port(), f"/session/{secret}/{what}")
    step(app)
    return status, body


def test_script_in_a_persons_name_is_text_for_the_others(app):
    def look(secrets, visits):
        assert ask(app, secrets[0], f"hello?tab={TAB}&name={quote(SCRIPT)}") == (200, b"here")
        return visits[1].people._others.content, visits[0].people._own.content

    for content in with_two_pages(app, look):
        assert "&lt;img src=x" in content
        assert "<img" not in content
        assert "<script" not in content


def test_a_name_without_end_is_cut(app):
    def look(secrets, visits):
        ask(app, secrets[0], f"name?name={'x' * 1500}")
        return visits[1].people._others.content

    longest = max(re.findall("x+", with_two_pages(app, look)), key=len)
    assert longest == "x" * MAX_NAME


@pytest.mark.parametrize("secret", ["", "x", "a" * 32, "..", "%2e%2e", "*"])
def test_a_secret_that_was_made_up_changes_nothing(app, secret):
    def look(secrets, visits):
        before = app.store.applied, app.store.state
        ask(app, secret, f"name?name={quote(SCRIPT)}")
        ask(app, secret, "go-to-person?number=1")
        return (app.store.applied, app.store.state) == before

    assert with_two_pages(app, look)


@pytest.mark.parametrize("number", ["-1", "1e9", "9" * 30, "", "1;2", quote("<b>"), "²"])
def test_a_person_that_was_made_up_is_nobody(app, number):
    def look(secrets, visits):
        before = tuple(visits[0].client.camera.position)
        status, _ = ask(app, secrets[0], f"go-to-person?number={quote(number, safe='%')}")
        return status, tuple(visits[0].client.camera.position) == before

    assert with_two_pages(app, look) == (404, True)


def test_one_page_cannot_move_the_camera_of_another(app):
    def look(secrets, visits):
        before = tuple(visits[1].client.camera.position)
        numbers = [person.number for person in app.store.state.people]
        for number in numbers:
            assert ask(app, secrets[0], f"go-to-person?number={number}")[0] == 200
        return tuple(visits[1].client.camera.position) == before

    assert with_two_pages(app, look)
