"""The token in the link, and the cookie that a browser gets for it.

The token is made at start and lives until the end of the process. A link carries it once; the answer is a cookie that
scripts cannot read and other sites cannot use, and a redirect that drops the token from the address, so that neither
history nor a screenshot gives it away. The cookie holds another secret than the link.

Guessing 256 bits is hopeless; wrong guesses are slowed down all the same, and never at the cost of those who are right.
"""

from __future__ import annotations

import asyncio
import hmac
import html
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from urllib.parse import parse_qsl, urlencode, urlsplit

from websockets.http11 import Request

from gazeloc_app import palette
from gazeloc_app.door.address import check_address, is_loopback
from gazeloc_app.door.hosts import is_https, is_websocket
from gazeloc_app.routes import Reply

WRONG_COSTS_S = 1.0
MAX_WRONG_AT_ONCE = 8
_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>GazeLoc</title>{head}
<style>{colors}body{{font:16px/1.5 system-ui,sans-serif;max-width:34em;margin:15vh auto;padding:0 1em}}
body{{color:var(--gazeloc-ink)}}input,button{{font:inherit;padding:.3em .6em}}</style><h1>GazeLoc</h1>{body}</html>
"""
_ASK = """<p>{sentence}</p><form method="get" action="/"><input name="token" placeholder="token" autocomplete="off"
aria-label="Token"> <button>Open</button></form><p><a href="/">Open it again</a> if you have been here before.</p>"""


def needs_token(host: str, allow_hosts: Sequence[str]) -> bool:
    """Whether others than this machine can reach the app: at another address than the loopback, or through a proxy."""
    return bool(allow_hosts) or not is_loopback(check_address(host))


def new_token() -> str:
    """A token that nobody can guess, for one run of the app."""
    return secrets.token_urlsafe(32)


@dataclass
class Login:
    """Who has the token may come in; for one port of this machine, since cookies do not tell ports apart."""

    port: int
    token: str = field(repr=False)
    _session: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)
    _wrong: int = 0

    @property
    def cookie(self) -> str:
        """The cookie's name."""
        return f"gazeloc-{self.port}"

    async def answer(self, request: Request) -> Reply | None:
        """None for a browser that was let in; else the redirect that lets it in, or the page that asks."""
        asked = dict(parse_qsl(urlsplit(request.path).query))
        token = asked.pop("token", None)
        if token is not None and not is_websocket(request) and _is_same(token, self.token):
            return self._let_in(request, f"/?{urlencode(asked)}" if asked else "/")
        shown = self._shown(request)
        if any(_is_same(value, self._session) for value in shown):
            return None
        if token is None and not shown:
            return _asking("This GazeLoc asks for a token: open the link that it printed when it was started.")
        return await self._wrong_answer()

    def _let_in(self, request: Request, place: str) -> Reply:
        secure = "; Secure" if is_https(request.headers) else ""
        headers = {
            "Set-Cookie": f"{self.cookie}={self._session}; Path=/; HttpOnly; SameSite=Strict{secure}",
            "Referrer-Policy": "no-referrer",
        }
        if request.headers.get("Sec-Fetch-Site", "none") in ("none", "same-origin"):
            return Reply(
                body=b"", content_type="text/plain; charset=utf-8", status=303, headers=headers | {"Location": place}
            )
        # A link from another site, a mail perhaps: a Strict cookie is not sent along the redirect of such a click, so
        # that a page of our own has to go on.
        head = f'<meta http-equiv="refresh" content="0;url={html.escape(place, quote=True)}">'
        return _page(head, "<p>One moment …</p>", HTTPStatus.OK, headers)

    def _shown(self, request: Request) -> list[str]:
        """What the browser has in our cookie."""
        pairs = ";".join(request.headers.get_all("Cookie")).split(";")
        cut = [pair.strip().partition("=") for pair in pairs]
        return [value for name, _, value in cut if name == self.cookie]

    async def _wrong_answer(self) -> Reply:
        if self._wrong >= MAX_WRONG_AT_ONCE:
            sentence = "Too many wrong tokens at once; wait a moment, then open the link that GazeLoc printed."
            return _page("", f"<p>{sentence}</p>", HTTPStatus.TOO_MANY_REQUESTS, {"Retry-After": "2"})
        self._wrong += 1
        try:
            await asyncio.sleep(WRONG_COSTS_S)
        finally:
            self._wrong -= 1
        return _asking(
            "This token is not, or no longer, the right one: GazeLoc makes a new one at each start; open the link that "
            "it printed last."
        )


def _is_same(shown: str, secret: str) -> bool:
    """Compared in a time that does not depend on where they differ."""
    return hmac.compare_digest(shown.encode("utf-8", "surrogateescape"), secret.encode())


def _asking(sentence: str) -> Reply:
    return _page("", _ASK.format(sentence=html.escape(sentence)), HTTPStatus.UNAUTHORIZED, {})


def _page(head: str, body: str, status: HTTPStatus, headers: dict[str, str]) -> Reply:
    policy = "default-src 'none'; style-src 'unsafe-inline'; form-action 'self'; frame-ancestors 'none'"
    text = _PAGE.format(head=head, body=body, colors=palette.css())
    return Reply(
        body=text.encode(),
        content_type="text/html; charset=utf-8",
        status=status.value,
        headers={"Content-Security-Policy": policy} | headers,
    )
