"""The door, in a real browser: the link, the cookie, a reload, and a page that came without."""

import pytest
from e2e.page import ViewerPage
from gazeloc_app.door.login import new_token
from gazeloc_app.routes import Routes, add_static_route
from gazeloc_app.server import make_server

pytestmark = pytest.mark.e2e


def test_the_link_opens_the_app_and_a_reload_does_too_without_the_token(browser, tmp_path):
    token = new_token()
    routes = Routes()
    add_static_route(routes)
    server = make_server(0, routes, allow_hosts=["gaze.test"], token=token)
    server.scene.add_icosphere("/ball", 0.5)
    address = f"http://localhost:{server.get_port()}"
    context = browser.new_context(viewport={"width": 500, "height": 400})
    try:
        page = context.new_page()
        page.goto(address)
        assert "asks for a token" in page.inner_text("body")
        page.fill("input[name=token]", token)
        page.press("input[name=token]", "Enter")
        viewer = ViewerPage(page)
        page.wait_for_selector("canvas")
        viewer.wait_until_drawn(20)
        assert token not in page.url
        assert not page.evaluate("document.cookie")
        viewer.open(address).wait_until_drawn(20)
        assert not viewer.errors
        page.goto("about:blank")
    finally:
        context.close()
        server.stop()
