"""Where the app may listen: on this machine only, as long as it has no login."""

from __future__ import annotations

import ipaddress

from gazeloc_core.errors import InputError


def check_loopback(host: str) -> str:
    """The address to bind to for a host that is this machine's loopback.

    Raises:
        InputError: for any other address.
    """
    address = "127.0.0.1" if host == "localhost" else host
    try:
        is_loopback = ipaddress.ip_address(address).is_loopback
    except ValueError:
        is_loopback = False
    if not is_loopback:
        raise InputError(
            f"--host {host}: GazeLoc listens on this machine only, for it has no login yet; use 127.0.0.1, and from "
            "elsewhere an SSH tunnel (`ssh -L 8080:localhost:8080 ...`)."
        )
    return address
