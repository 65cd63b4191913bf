# Copyright 2026 The rt_robot_os authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Runs the application with its parts and its listening socket until a signal ends it."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
import signal
import socket
import sys
from types import FrameType

from rt_robot_os.base.errors import StartError
from rt_robot_os.messages.uplink.frames import FRAME_BYTES
from rt_robot_os.monitor.app import create_app
from rt_robot_os.monitor.connections import allow_files
from rt_robot_os.monitor.connections import Config
from rt_robot_os.monitor.connections import Connections
from rt_robot_os.monitor.connections import Loop
from rt_robot_os.monitor.demo import Companions
from rt_robot_os.monitor.demo import running
from rt_robot_os.monitor.demo import story_of
from rt_robot_os.monitor.live import residents
from rt_robot_os.monitor.live.hub import Hub
from rt_robot_os.monitor.live.media_connection import MediaHub
from rt_robot_os.monitor.maps import Maps
from rt_robot_os.monitor.media_store import MediaStore
from rt_robot_os.monitor.security.accounts import Accounts
from rt_robot_os.monitor.security.certificates import CA_FILE
from rt_robot_os.monitor.security.certificates import names_of
from rt_robot_os.monitor.services import Services
from rt_robot_os.monitor.settings import MonitorSettings
from rt_robot_os.monitor.store.retention import RetentionPolicy
from rt_robot_os.monitor.store.store import Store
from rt_robot_os.monitor.store.writer import RecordWriter
import uvicorn

_BACKLOG = 512
_EVERYWHERE = ('0.0.0.0', '::')
SWITCH_S = 0.001
#: Name of the default database in the folder.
DATABASE = 'monitor.db'


def make_services(settings: MonitorSettings) -> Services:
    """Open the database and make the parts."""
    folder = settings.where
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    store = Store.open(settings.database or str(folder / DATABASE))
    try:
        store.serve_alone()
        accounts = Accounts.open(store.engine, folder)
        accounts.restore_limits()
    except BaseException:
        store.close()
        raise
    store.keep(RetentionPolicy(settings.raw_days, settings.minutes_days, settings.network_days,
                               settings.network_days))
    hub = Hub(settings.heartbeat_s, settings.command_s)
    hub.remember(store.robots(), store.alarms(people=None, is_open=True, limit=1000))
    hub.retire(set(hub.robots) - set(accounts.robots.tokens()))
    residents.apply(hub, accounts.residents.all())
    media = MediaHub(MediaStore(folder / 'media', settings.media_mb, settings.media_days))
    return Services(settings, store, RecordWriter(store), hub, accounts, accounts.audit,
                    maps=Maps(folder / 'maps'), media=media)


def serve(settings: MonitorSettings, companions: Companions | None = None) -> None:
    """
    Serve until a signal ends the process.

    :param companions: processes next to it.
    :raises StartError: it cannot start.
    """
    services = make_services(settings)
    server = make_server(services)
    listening = listen(settings)

    def end(number: int, frame: FrameType | None) -> None:
        server.should_exit = True
    # Also for signals before and after serving: uvicorn raises the signal again at its end.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    print(f'monitor: {address(settings, listening)}', file=sys.stderr, flush=True)
    link = services.accounts.setup_link(address(settings, listening))
    if link is not None:
        print(f'monitor: nobody has an account yet; open this once to make the first:\n  {link}',
              file=sys.stderr, flush=True)
    # The thread that writes to the database releases the GIL to the loop earlier than after 5 ms.
    sys.setswitchinterval(SWITCH_S)
    with ExitStack() as stack:
        if companions is not None:
            services.story = story_of(companions, services.hub)
            stack.enter_context(running(
                companions, services.accounts, settings.where,
                address(settings, listening, 'localhost').replace('http', 'ws', 1),
                _authority(settings)))
        server.run([listening])


def address(settings: MonitorSettings, listening: socket.socket, own: str = '') -> str:
    """
    Return the URL to open in a browser.

    :param own: name of this machine when it listens on all addresses; by default the first name of
        the certificate, since the wildcard address cannot be opened.
    """
    scheme = 'https' if settings.has_tls else 'http'
    name = settings.host
    if name in _EVERYWHERE and settings.has_tls:
        name = own or next(iter(names_of(Path(settings.certificate))), name)
    host = f'[{name}]' if ':' in name else name
    return f'{scheme}://{host}:{listening.getsockname()[1]}'


def _authority(settings: MonitorSettings) -> str:
    """Return the file of the local authority that signed the certificate, if it exists."""
    found = Path(settings.certificate).with_name(CA_FILE) if settings.has_tls else Path()
    return str(found) if found.is_file() else ''


def make_server(services: Services) -> uvicorn.Server:
    """Make the server of an application; ``server.run([listen(settings)])`` runs it."""
    settings = services.settings
    services.connections = Connections(allow_files(settings.connections))
    # Frames are not compressed: that would be done for each client, and take most of the CPU.
    return uvicorn.Server(Config(
        create_app(services), services.connections, loop=f'{Loop.__module__}:{Loop.__name__}',
        log_level='warning', access_log=False, server_header=False, ws_per_message_deflate=False,
        ws_max_size=FRAME_BYTES, ws_ping_interval=20, ws_ping_timeout=20, timeout_keep_alive=10,
        backlog=_BACKLOG, lifespan='on', ssl_certfile=settings.certificate or None,
        ssl_keyfile=settings.key or None, timeout_graceful_shutdown=3))


def listen(settings: MonitorSettings) -> socket.socket:
    """
    Open the socket.

    :raises StartError: the port is in use or the address is not one of this machine.
    """
    try:
        family = socket.getaddrinfo(settings.host, settings.listens_on,
                                    type=socket.SOCK_STREAM)[0]
        with ExitStack() as stack:
            found = stack.enter_context(socket.socket(family[0], family[1]))
            found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            found.bind(family[4])
            found.listen(_BACKLOG)  # earlier clients wait, and are not refused
            stack.pop_all()
            return found
    except OSError as error:
        raise StartError(f'host {settings.host}, port {settings.listens_on}: {error.strerror}; '
                         'another program may listen there: choose another port with --port'
                         ) from error
