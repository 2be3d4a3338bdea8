"""Our own GET routes beside the viewer's page: pictures by URL, and the files of static/.

Handlers are `async def handler(asked) -> Reply` and run on the server's event loop, so they must not block. What a
handler raises as `GazelocError` reaches the page as its sentence.
"""

from __future__ import annotations

import logging
import mimetypes
import re
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from urllib.parse import parse_qsl, unquote, urlsplit

from gazeloc_app.drawing.render_process import Closing, Superseded
from gazeloc_core.errors import GazelocError, InputError
from gazeloc_core.resources import static_file

_log = logging.getLogger(__name__)
_REVISED_S = 3600
"""How long a browser may keep a picture whose URL carries `rev`; without it, it must ask again."""


@dataclass(frozen=True, kw_only=True)
class Reply:
    """What a route answers."""

    body: bytes
    content_type: str
    status: int = 200
    cache_s: int = 0
    """Seconds for which the browser may reuse it; 0 forbids."""
    headers: Mapping[str, str] = field(default_factory=dict)
    """Further headers."""


@dataclass(frozen=True, kw_only=True)
class Asked:
    """A GET request: the `{names}` of the route's pattern, and the query; all from the browser, so never trusted."""

    names: Mapping[str, str]
    query: Mapping[str, str] = field(default_factory=dict)


Handler = Callable[[Asked], Awaitable[Reply]]


class Routes:
    """The GET routes of the app, e.g. `routes.get("/frames/{recording}/{index}.jpg", handler)`; first match wins."""

    def __init__(self) -> None:
        self._routes: list[tuple[re.Pattern[str], Handler]] = []

    def get(self, pattern: str, handler: Handler) -> None:
        """Answer paths of this pattern; `{name}` stands for anything but a slash."""
        pieces = re.split(r"\{(\w+)\}", pattern)
        regex = "".join(f"(?P<{piece}>[^/]+)" if i % 2 else re.escape(piece) for i, piece in enumerate(pieces))
        self._routes.append((re.compile(regex), handler))

    async def answer(self, target: str) -> Reply | None:
        """The reply to a request's path and query, None where no route is meant."""
        url = urlsplit(target)
        for regex, handler in self._routes:
            match = regex.fullmatch(url.path)
            if match:
                names = {name: unquote(value) for name, value in match.groupdict().items()}
                return await _guarded(handler, Asked(names=names, query=dict(parse_qsl(url.query))))
        return None


async def _guarded(handler: Handler, asked: Asked) -> Reply:
    try:
        return await handler(asked)
    except (Superseded, Closing) as error:
        _log.debug("%s", error)
        return Reply(body=b"", content_type="image/jpeg", status=204)  # the page has moved on, or we end
    except GazelocError as error:
        return _text(404 if isinstance(error, InputError) else 503, str(error))
    except Exception:
        _log.exception("the route failed for %s", dict(asked.names))
        return _text(500, "GazeLoc failed to answer this request; its log says more.")


def _text(status: int, sentence: str) -> Reply:
    return Reply(body=sentence.encode(), content_type="text/plain; charset=utf-8", status=status)


def add_static_route(routes: Routes) -> None:
    """`/static/<name>`: the files of static/, which carry no revision and so are asked for again each time."""

    async def answer(asked: Asked) -> Reply:
        path = static_file(asked.names["name"])
        kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
        return Reply(body=path.read_bytes(), content_type=kind)

    routes.get("/static/{name}", answer)


def add_picture_routes(
    routes: Routes,
    frame: Callable[[str, int, Mapping[str, str]], Awaitable[bytes]],
    render: Callable[[str, int, Mapping[str, str]], Awaitable[bytes]],
    thumbnail: Callable[[str, int, Mapping[str, str]], Awaitable[bytes]],
) -> None:
    """`/frames/<recording>/<index>.jpg` `/renders/…` and `/thumbnails/…` likewise: JPEG bytes from the app's callables.

    All take the recording's name, the frame's index and the query. A URL with `?rev=` may be kept by the browser:
    the page changes `rev` whenever the picture may have changed.
    """

    def handler_of(picture: Callable[[str, int, Mapping[str, str]], Awaitable[bytes]]) -> Handler:
        async def answer(asked: Asked) -> Reply:
            index = asked.names["index"]
            if not re.fullmatch(r"[0-9]{1,9}", index):
                raise InputError(f"{index!r} is not a frame's number.")
            body = await picture(asked.names["recording"], int(index), asked.query)
            return Reply(body=body, content_type="image/jpeg", cache_s=_REVISED_S if "rev" in asked.query else 0)

        return answer

    routes.get("/frames/{recording}/{index}.jpg", handler_of(frame))
    routes.get("/thumbnails/{recording}/{index}.jpg", handler_of(thumbnail))
    routes.get("/renders/{recording}/{index}.jpg", handler_of(render))
