"""Who comes in from elsewhere: the token in the link, the cookie that follows, and the names the app answers to."""

import asyncio
import re
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from http.cookies import SimpleCookie

import pytest
import websockets.exceptions
from gazeloc_app.door import login
from gazeloc_app.door.address import check_address, link_host
from gazeloc_app.door.hosts import checked_name, own_hosts
from gazeloc_app.door.login import needs_token, new_token
from gazeloc_app.routes import Reply, Routes
from gazeloc_app.server import make_server
from visitor import get, page

from gazeloc_core.errors import InputError

TOKEN = new_token()


@pytest.fixture(scope="module")
def port():
    """An app on every network, and behind a proxy as gaze.lab.example."""
    routes = Routes()

    async def secret(asked):
        return Reply(body=b"a picture", content_type="text/plain")

    routes.get("/secret", secret)
    server = make_server(0, routes, host="0.0.0.0", allow_hosts=["gaze.lab.example"], token=TOKEN)
    yield server.get_port()
    server.stop()


@pytest.fixture(autouse=True)
def no_long_waits(monkeypatch):
    monkeypatch.setattr(login, "WRONG_COSTS_S", 0.3)


def cookie(port, **headers):
    """The cookie that the link gives, as the browser sends it back."""
    status, answered, _ = get(port, f"/?token={TOKEN}", **headers)
    assert status in (200, 303)
    (morsel,) = SimpleCookie(answered["Set-Cookie"]).values()
    return f"{morsel.key}={morsel.value}"


def handshake_status(port, **options):
    """101, or the status that refuses a page's connection."""

    async def talk():
        try:
            async with page(port, **options):
                return 101
        except websockets.exceptions.InvalidStatus as refused:
            return refused.response.status_code

    return asyncio.run(talk())


def test_without_the_token_nothing_is_shown(port):
    for path in ("/", "/secret", "/static/comparison.html", "/frames/a/1.jpg"):
        status, headers, body = get(port, path)
        assert status == 401
        assert b"asks for a token" in body
        assert "Set-Cookie" not in headers
        assert headers["Cache-Control"] == "no-store"
    assert handshake_status(port) == 401


def test_the_link_gives_a_cookie_once_and_drops_the_token_from_the_address(port):
    status, headers, body = get(port, f"/?token={TOKEN}&fixedDpr=1")
    assert (status, body, headers["Location"]) == (303, b"", "/?fixedDpr=1")
    (morsel,) = SimpleCookie(headers["Set-Cookie"]).values()
    assert morsel["httponly"]
    assert morsel["samesite"] == "Strict"
    assert not morsel["secure"]
    assert TOKEN not in headers["Set-Cookie"]
    kept = f"{morsel.key}={morsel.value}"
    assert get(port, Cookie=kept)[0] == 200
    assert get(port, "/secret", Cookie=f"theme=dark; {kept}; x=y")[2] == b"a picture"
    assert handshake_status(port, Cookie=kept) == 101


def test_behind_tls_the_cookie_is_for_tls_only(port):
    _, headers, _ = get(port, f"/?token={TOKEN}", Host="gaze.lab.example", X_Forwarded_Proto="https")
    assert "; Secure" in headers["Set-Cookie"]


def test_a_link_in_another_sites_page_comes_in_too(port):
    """A Strict cookie is not sent along a redirect that another site began, so our own page goes on."""
    status, headers, body = get(port, f"/?token={TOKEN}", Sec_Fetch_Site="cross-site", Sec_Fetch_Dest="document")
    assert status == 200
    assert "Set-Cookie" in headers
    assert b'http-equiv="refresh" content="0;url=/"' in body
    assert TOKEN.encode() not in body


@pytest.mark.parametrize(
    "change", [lambda t: "x", lambda t: t[:-1], lambda t: t + "x", str.swapcase, lambda t: "%ff%00"]
)
def test_a_wrong_token_is_slow_and_lets_nobody_in(port, change):
    begun = time.monotonic()
    status, headers, body = get(port, f"/?token={change(TOKEN)}")
    assert status == 401
    assert time.monotonic() - begun >= 0.3
    assert "Set-Cookie" not in headers
    assert b"not, or no longer, the right one" in body


def test_a_wrong_cookie_is_slow_too_and_a_token_is_no_cookie(port):
    name = cookie(port).partition("=")[0]
    for wrong in ("x", TOKEN, ""):
        begun = time.monotonic()
        assert get(port, Cookie=f"{name}={wrong}")[0] == 401
        assert time.monotonic() - begun >= 0.3
        assert handshake_status(port, Cookie=f"{name}={wrong}") == 401


def test_many_wrong_tokens_at_once_are_turned_away_and_who_is_right_comes_in_meanwhile(port, monkeypatch):
    monkeypatch.setattr(login, "WRONG_COSTS_S", 1.5)

    async def crowd():
        asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(20))
        guesses = [asyncio.create_task(asyncio.to_thread(get, port, f"/?token=guess{i}")) for i in range(16)]
        await asyncio.sleep(0.5)
        begun = time.monotonic()
        right = await asyncio.to_thread(get, port, f"/?token={TOKEN}")
        assert time.monotonic() - begun < 1.0
        return right[0], [(await guess)[0] for guess in guesses]

    right, statuses = asyncio.run(crowd())
    assert right == 303
    assert set(statuses) == {401, 429}


def test_two_runs_have_two_tokens_and_a_cookie_of_one_does_not_open_the_other(port):
    other = make_server(0, Routes(), host="0.0.0.0", token=new_token())
    try:
        value = cookie(port).partition("=")[2]
        assert get(other.get_port(), f"/?token={TOKEN}")[0] == 401
        assert get(other.get_port(), Cookie=f"gazeloc-{other.get_port()}={value}")[0] == 401
    finally:
        other.stop()


@pytest.mark.parametrize(
    "host", ["gaze.lab.example", "GAZE.lab.example:443", "localhost", socket.gethostname(), "[::1]"]
)
def test_it_answers_to_its_own_names(port, host):
    assert get(port, Host=host)[0] == 401


def test_it_answers_to_the_address_that_was_connected_to(port):
    own = link_host("0.0.0.0")
    if own == "localhost":
        pytest.skip("this machine is in no network")
    assert get(port, to=own, Host=f"{own}:{port}")[0] == 401
    assert get(port, to="127.0.0.1", Host=f"{own}:{port}")[0] == 403


@pytest.mark.parametrize(
    "host", ["evil.example", "gaze.lab.example.evil", "xgaze.lab.example", "8.8.8.8", "a b", "@", ""]
)
def test_a_name_that_is_not_its_own_is_refused_with_token_and_cookie(port, host):
    assert get(port, f"/?token={TOKEN}", Host=host)[0] == 403
    assert get(port, Host=host, Cookie=cookie(port))[0] == 403
    if re.fullmatch(r"[\w.]+", host):  # our visitor itself refuses to ask for the others
        assert handshake_status(port, host=host, Cookie=cookie(port)) == 403


@pytest.mark.parametrize("origin", ["http://evil.example", "https://evil.example:443", "null", None])
def test_another_pages_connection_is_refused_even_with_the_cookie(port, origin):
    assert handshake_status(port, origin=origin, Cookie=cookie(port)) == 403


def test_a_page_behind_a_tls_proxy_may_connect(port):
    options = {"host": "gaze.lab.example", "origin": "https://gaze.lab.example"}
    assert handshake_status(port, Cookie=cookie(port), **options) == 101


@pytest.mark.parametrize(("host", "names"), [("0.0.0.0", ()), ("192.168.1.5", ()), ("::", ()), ("127.0.0.1", ("a.b",))])
def test_where_others_can_come_a_token_is_needed_and_there_is_no_way_without(host, names):
    assert needs_token(host, names)
    with pytest.raises(AssertionError, match="token"):
        make_server(0, Routes(), host=host, allow_hosts=names)


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1", "127.3.2.1"])
def test_on_this_machine_none_is_needed(host):
    assert not needs_token(host, ())
    assert link_host(host) == "localhost"


def test_a_link_names_the_address():
    assert link_host("192.168.1.5") == "192.168.1.5"
    assert link_host("fe80::5") == "[fe80::5]"
    assert re.fullmatch(r"[0-9.]+|\[[0-9a-f:]+\]|localhost", link_host("::"))


@pytest.mark.parametrize("name", ["http://a", "a:80", "a/b", "", "-a", "a b", "*", "a\n"])
def test_a_further_name_is_a_bare_name(name):
    with pytest.raises(InputError, match="--allow-host"):
        checked_name(name)


def test_an_address_has_many_spellings():
    hosts = own_hosts("::", ["10.0.0.7"])
    assert hosts.allows("[::ffff:10.0.0.7]:8080", None)
    assert hosts.allows("[0:0:0::1]", None)
    assert hosts.allows("10.0.0.9", "::ffff:10.0.0.9")
    assert not hosts.allows("10.0.0.9", "10.0.0.8")
    assert check_address("0:0::1") == "::1"
