"""Our GET routes, without a server."""

import asyncio

import pytest
from gazeloc_app.drawing.render_process import Closing, Superseded
from gazeloc_app.routes import Reply, Routes, add_picture_routes, add_static_route

from gazeloc_core.errors import InputError, RenderError


def ask(routes: Routes, target: str) -> Reply | None:
    return asyncio.run(routes.answer(target))


@pytest.fixture
def pictures():
    """The picture routes with callables that answer what they were asked."""
    routes = Routes()

    async def frame(recording, index, query):
        return f"frame {recording} {index} {dict(query)}".encode()

    async def render(recording, index, query):
        if index == 404:
            raise InputError("There is no frame 404.")
        if index == 503:
            raise RenderError("The process died.")
        if index == 410:
            raise Closing
        if index == 409:
            raise Superseded("A newer picture was asked for.")
        if index == 500:
            raise ZeroDivisionError
        return b"render"

    add_picture_routes(routes, frame, render, frame)
    return routes


def test_names_and_query_reach_the_handler_decoded(pictures):
    reply = ask(pictures, "/frames/the%20walk/12.jpg?client=3&rev=a%2Fb")
    assert reply.body == b"frame the walk 12 {'client': '3', 'rev': 'a/b'}"
    assert (reply.status, reply.content_type) == (200, "image/jpeg")


def test_only_a_picture_with_a_revision_may_be_kept(pictures):
    assert ask(pictures, "/renders/a/1.jpg").cache_s == 0
    assert ask(pictures, "/renders/a/1.jpg?rev=5").cache_s > 0


@pytest.mark.parametrize("target", ["/", "/frames/a.jpg", "/frames/a/b/1.jpg", "/frames//1.jpg", "/x/frames/a/1.jpg"])
def test_other_paths_are_not_ours(pictures, target):
    assert ask(pictures, target) is None


@pytest.mark.parametrize("index", ["-1", "x", "1e3", "9999999999", "%31%2F"])
def test_a_frame_is_a_number(pictures, index):
    assert ask(pictures, f"/frames/a/{index}.jpg").status == 404


@pytest.mark.parametrize("index", [409, 410])
def test_a_picture_that_the_page_no_longer_shows_and_one_when_the_app_ends_are_no_errors(pictures, index):
    reply = ask(pictures, f"/renders/a/{index}.jpg?rev=5")
    assert (reply.status, reply.body, reply.cache_s) == (204, b"", 0)


@pytest.mark.parametrize("status", [404, 503])
def test_an_expected_failure_is_a_sentence(pictures, status):
    reply = ask(pictures, f"/renders/a/{status}.jpg")
    assert reply.status == status
    assert reply.body.endswith(b".")
    assert reply.cache_s == 0


def test_a_bug_is_not_shown_to_the_page(pictures):
    reply = ask(pictures, "/renders/a/500.jpg")
    assert reply.status == 500
    assert b"ZeroDivision" not in reply.body


def test_static_files_and_nothing_beside_them(tmp_path, monkeypatch):
    from gazeloc_core import resources

    (tmp_path / "static").mkdir()
    (tmp_path / "static" / "a.css").write_text("body {}")
    (tmp_path / "secret").write_text("s")
    monkeypatch.setattr(resources, "_PACKAGE", tmp_path / "gazeloc_core")
    routes = Routes()
    add_static_route(routes)
    reply = ask(routes, "/static/a.css")
    assert (reply.status, reply.content_type, reply.body) == (200, "text/css", b"body {}")
    assert ask(routes, "/static/%2e%2e%2fsecret").status == 404
    assert ask(routes, "/static/none.css").status == 404
