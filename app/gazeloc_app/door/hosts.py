"""Under which names the app may be asked for, and which pages may talk to it.

A page on another site can make a browser send requests here, and with DNS rebinding even under a name of its own. Both
show in what the browser itself writes: Host names what was asked for, Origin the page that asks.
"""

from __future__ import annotations

import ipaddress
import re
import socket
from collections.abc import Iterable
from dataclasses import dataclass
from http import HTTPStatus

from websockets.datastructures import Headers
from websockets.http11 import Request

from gazeloc_app.door.address import is_loopback
from gazeloc_core.errors import InputError

LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})
_HOST = re.compile(r"(\[[0-9A-Fa-f:.]{2,45}\]|[A-Za-z0-9._-]{1,253})(:[0-9]{1,5})?")
_NAME = re.compile(r"[A-Za-z0-9]([A-Za-z0-9._-]{0,251}[A-Za-z0-9])?")


@dataclass(frozen=True, kw_only=True)
class Refusal:
    """Why a request is not answered."""

    status: HTTPStatus
    sentence: str


@dataclass(frozen=True)
class Hosts:
    """Names in lower case, without ports: `ssh -L` and proxies may change the port."""

    names: frozenset[str]
    is_open: bool
    """Whether others than this machine may come, so that the address that they connected to is a name too."""

    def allows(self, host: str, local_address: str | None) -> bool:
        """Whether a Host header names us; `local_address` is this end of the very connection."""
        match = _HOST.fullmatch(host)
        if match is None:
            return False
        name = _plain(match[1].strip("[]").lower())
        return name in self.names or (self.is_open and local_address is not None and name == _plain(local_address))

    def check(self, request: Request, local_address: str | None) -> Refusal | None:
        """None for our own page under one of our names; else why not.

        A websocket must come from a page of the very same origin. Another site's page may link here, but may not
        embed our page or pictures.
        """
        hosts = request.headers.get_all("Host")
        if len(hosts) != 1 or not self.allows(hosts[0], local_address):
            where = "under its own address" if self.is_open else "on this machine only; open it as http://localhost"
            return _forbidden(f"GazeLoc answers {where}; start it with --allow-host to give it another name.")
        origins = request.headers.get_all("Origin")
        if len(origins) > 1 or (origins and origins[0] not in (f"http://{hosts[0]}", f"https://{hosts[0]}")):
            return _forbidden("Another page may not talk to GazeLoc; a proxy must pass the Host header on as it came.")
        if is_websocket(request):
            return None if origins else _forbidden("GazeLoc's connection is for its own page in a browser.")
        site = request.headers.get("Sec-Fetch-Site", "none")
        is_page = request.path.partition("?")[0] in ("/", "/index.html")  # our routes may change what is shown
        is_link = is_page and request.headers.get("Sec-Fetch-Dest") == "document"
        if site not in ("same-origin", "none") and not is_link:
            return _forbidden("Another page may not show GazeLoc's pictures.")
        return None


def own_hosts(address: str, extra: Iterable[str] = ()) -> Hosts:
    """The names of an app that is bound to `address`; `extra` are those that a proxy gives it.

    Raises:
        InputError: if one of `extra` is no name.
    """
    added = {checked_name(name) for name in extra}
    if is_loopback(address):
        return Hosts(LOOPBACK_NAMES | added | {address}, is_open=False)
    own = {name.lower() for name in (socket.gethostname(), f"{socket.gethostname()}.local", socket.getfqdn())}
    return Hosts(LOOPBACK_NAMES | added | own | {address}, is_open=True)


def checked_name(name: str) -> str:
    """A name for --allow-host, in lower case.

    Raises:
        InputError: if it holds anything but a name, a scheme or a port for example.
    """
    plain = _plain(name.strip("[]").lower())
    if _NAME.fullmatch(plain) is None and not _is_ip(plain):
        raise InputError(f"--allow-host {name}: give the bare name, e.g. gaze.lab.example, without http:// and port.")
    return plain


def is_websocket(request: Request) -> bool:
    """Whether the browser asks to upgrade the connection."""
    return "websocket" in (value.strip().lower() for value in request.headers.get_all("Upgrade"))


def is_https(headers: Headers) -> bool:
    """Whether a proxy says that the browser's side of the connection is encrypted."""
    return headers.get_all("X-Forwarded-Proto") == ["https"]


def _forbidden(sentence: str) -> Refusal:
    return Refusal(status=HTTPStatus.FORBIDDEN, sentence=sentence)


def _is_ip(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _plain(name: str) -> str:
    """One spelling per address: `::ffff:10.0.0.1` and `0:0::1` are `10.0.0.1` and `::1`."""
    try:
        address = ipaddress.ip_address(name.partition("%")[0])
    except ValueError:
        return name
    mapped = address.ipv4_mapped if isinstance(address, ipaddress.IPv6Address) else None
    return str(mapped or address)
