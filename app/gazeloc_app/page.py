"""The viewer's page with what GazeLoc adds to it: its title, and the style sheets and scripts of static/page/.

viser ships one HTML file and has no place for either. They are put in front of its `</head>`, in the order of their
names, so that they are there before the viewer starts. Scripts talk to the app through our GET routes (routes.py).
"""

from __future__ import annotations

import gzip
import html
import re
from functools import lru_cache

from websockets.http11 import Response

from gazeloc_app import palette
from gazeloc_core.resources import static_files

_PAGES = ("/", "/index.html")


def dress(response: Response, path: str, title: str) -> None:
    """Add title, styles and scripts where the response is the viewer's page; leave any other as it is."""
    if path.partition("?")[0] not in _PAGES or response.status_code != 200 or response.body is None:
        return
    is_zipped = response.headers.get("Content-Encoding") == "gzip"
    body = _dressed(bytes(response.body), is_zipped, title)
    response.body = body
    del response.headers["Content-Length"]
    response.headers["Content-Length"] = str(len(body))


@lru_cache(maxsize=4)
def _dressed(body: bytes, is_zipped: bool, title: str) -> bytes:
    page = (gzip.decompress(body) if is_zipped else body).decode("utf-8")
    page = re.sub(r"<title>.*?</title>", lambda _: f"<title>{html.escape(title)}</title>", page, count=1)
    page = page.replace("</head>", f"{_head()}</head>", 1)
    return gzip.compress(page.encode()) if is_zipped else page.encode()


def _head() -> str:
    files = [(path.suffix, path.read_text(encoding="utf-8")) for path in static_files("page")]
    icon = '<link rel="icon" type="image/svg+xml" href="/static/favicon.svg">\n'
    colors = f"<style>\n{palette.css()}</style>\n"
    styles = [f"<style>\n{text}</style>\n" for suffix, text in files if suffix == ".css"]
    scripts = [f"<script>\n{text}</script>\n" for suffix, text in files if suffix == ".js"]
    return "".join([icon, colors, *styles, *scripts])
