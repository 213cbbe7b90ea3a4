"""Which requests may come in: against DNS rebinding and against other sites in the same browser.

A page of another site can make a browser send requests to loopback, and a name of its own that
resolves to loopback even makes that browser take them for same-origin. So the Host header must
be a name of ours (https://owasp.org/www-community/attacks/DNS_Rebinding), and where a browser
says which site a request comes from, it must be this one.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Mapping


class HostGuard:
    """Judges requests by their headers.

    Args:
        host: the address the page is bound to.
        port: the port it is bound to.
        names: further host names that are ours, with a port if a proxy changes it.
        open_to_network: bound beyond loopback: then any plain IP address may be asked for, which
            is safe because rebinding needs a name.
        tls: served over TLS: then nothing comes from a page that was not.
    """

    def __init__(
        self, host: str, port: int, names: tuple[str, ...], open_to_network: bool,
        tls: bool = False,
    ) -> None:  # fmt: skip
        self._port, self._tls = port, tls
        self._open = open_to_network
        own = {"localhost", "127.0.0.1", "[::1]", _literal(host)}
        usual_port = 443 if tls else 80
        self._own = {f"{name}:{port}" for name in own} | (own if port == usual_port else set())
        # Browsers leave out the port that belongs to the scheme; a TLS proxy uses 443.
        self._named = {name if ":" in name else f"{name}:{port}" for name in names}
        self._named |= {name for name in names if ":" not in name}

    def refusal(self, headers: Mapping[str, str], path: str) -> str | None:
        """Why a request is refused, None if it may pass.

        Another site may link to the page, and nothing else: not even a picture of it is anybody's
        to embed.

        Args:
            headers: of the request, case-insensitive.
            path: that is asked for.
        """
        host = headers.get("Host", "").lower()
        if not self._is_ours(host):
            return f"host {host[:80]!r} is not this page's: use the address that was printed"
        origin = headers.get("Origin")
        if origin is not None and origin.lower() not in self._origins(host):
            return f"origin {origin[:80]!r} may not use this page"
        site = headers.get("Sec-Fetch-Site", "none")
        followed_link = path == "/" and headers.get("Sec-Fetch-Dest") == "document"
        if site not in ("same-origin", "none") and not followed_link:
            return f"a {site[:20]} request may not use this page"
        return None

    def _origins(self, host: str) -> tuple[str, ...]:
        """What a page of ours says it comes from; https where a proxy may stand before it."""
        if self._tls:
            return (f"https://{host}",)
        plain = f"http://{host}"
        return (plain, f"https://{host}") if host in self._named else (plain,)

    def _is_ours(self, host: str) -> bool:
        if host in self._own or host in self._named:
            return True
        name, _, port = host.rpartition(":")
        if not self._open or port != str(self._port):
            return False
        try:
            ipaddress.ip_address(name.strip("[]"))
        except ValueError:
            return False
        return True


def _literal(host: str) -> str:
    return f"[{host}]" if ":" in host else host.lower()
