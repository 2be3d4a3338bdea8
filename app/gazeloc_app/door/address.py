"""Where the app may listen: any address of this machine; on all but the loopback a token is asked for."""

from __future__ import annotations

import contextlib
import ipaddress
import socket

from gazeloc_core.errors import InputError


def check_address(host: str) -> str:
    """The IP address to bind to.

    Raises:
        InputError: if `host` is neither an IP address nor `localhost`: a name may point anywhere tomorrow.
    """
    address = "127.0.0.1" if host == "localhost" else host
    try:
        return str(ipaddress.ip_address(address))
    except ValueError:
        raise InputError(
            f"--host {host}: this is not an address; give 127.0.0.1 for this machine only, 0.0.0.0 for every network "
            "that it is in, or one of its own addresses."
        ) from None


def is_loopback(address: str) -> bool:
    """Whether only this machine itself can reach an IP address."""
    return ipaddress.ip_address(address).is_loopback


def link_host(host: str) -> str:
    """How a link names the address that is listened to; for all networks, the address that others see most likely.

    Connecting a datagram socket sends nothing: it asks the system which of its addresses it would use.
    """
    found = ipaddress.ip_address(check_address(host))
    if found.is_loopback:
        return "localhost"
    if not found.is_unspecified:
        return f"[{found}]" if found.version == 6 else str(found)
    for family, elsewhere in ((socket.AF_INET, "192.0.2.1"), (socket.AF_INET6, "2001:db8::1")):
        with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((elsewhere, 9))  # an address of the documentation's, which nobody has
            own = str(probe.getsockname()[0])
            return f"[{own}]" if family == socket.AF_INET6 else own
    return "localhost"
