"""A page as it is served: port, TLS, login, guard and their thread, as the settings say."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

from heel.services.runtime.certificate import end_of_pem
from heel.services.runtime.service import ServiceContext
from heel.services.security.folder import own_names
from heel.services.web.address import reachable_host, show_code
from heel.services.web.connections import Connections, room_for_connections
from heel.services.web.door import MOST_LOGINS, Door
from heel.services.web.guard import HostGuard
from heel.services.web.login import Login
from heel.services.web.server import ServerThread, listen, tls_context
from heel.services.web.settings import WebServiceSettings, is_loopback
from heel.services.web.worker import Worker


@contextmanager
def serving(
    context: ServiceContext[WebServiceSettings], page: Callable[..., Door]
) -> Iterator[str]:
    """Serve a page while the block runs; its address.

    Args:
        context: of the service.
        page: makes it of what keeps the door.

    Raises:
        HeelError: the port is taken.
        SettingsError: a file of the login or of TLS cannot be used.
    """
    settings = context.settings
    listener = listen(settings.host, settings.port)
    host, port = listener.getsockname()[:2]
    shown_host = f"[{host}]" if ":" in host else host
    tls = None
    with ExitStack() as resources:
        resources.callback(listener.close)
        login = None if settings.users_file is None else Login(settings.users_file)
        if settings.certificate is not None:
            tls = tls_context(settings.certificate, settings.certificate_key)
            if (until := end_of_pem(settings.certificate)) is not None:
                context.statistics.certificates_until.append(until)
        names = settings.names
        if login is not None:
            # Another site's name for this machine has none of the cookies.
            names += own_names()
            shown_host = reachable_host(shown_host)
        url = f"{'http' if tls is None else 'https'}://{shown_host}:{port}/"
        wide = not is_loopback(settings.host)
        site = page(
            guard=HostGuard(host, port, names, wide, tls is not None),
            connections=Connections(room_for_connections(), context.log),
            login=login,
            checks=None if login is None else Worker("login", MOST_LOGINS, resources),
            tls=tls is not None,
        )
        resources.enter_context(ServerThread(site, listener, context.log, tls))
        context.log.info("page at %s", url)
        if wide and login is None:
            context.log.warning("whoever reaches %s can watch and drive", url)
        if wide and sys.stderr.isatty():
            show_code(url, sys.stderr)
        yield url
