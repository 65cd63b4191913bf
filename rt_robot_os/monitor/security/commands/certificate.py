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

"""`monitor certificate`: TLS for a network without public DNS names."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
import socket
from typing import Any

from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.monitor.security import certificates
from rt_robot_os.monitor.security.commands.opening import add_where
from rt_robot_os.monitor.security.commands.opening import settings_of

_INSTALL = """Install {authority} on each tablet once, so that it trusts this server:
  iPad      send the file to it, open it, Settings > General > VPN & Device Management > install;
            then Settings > General > About > Certificate Trust Settings > switch it on
  Android   Settings > Security > Encryption & credentials > Install a certificate > CA certificate
  Windows   open the file > Install Certificate > Local Machine > Trusted Root Authorities
  Debian    copy it to /usr/local/share/ca-certificates/monitor.crt, then update-ca-certificates
            (Chromium: chrome://certificate-manager; Firefox: Settings > Certificates > Import)
  robot     copy it there and name it as ca_file of the gateway
Compare its fingerprint there: {fingerprint}
Keep {secret} secret; it is needed again only for a renewal."""


def add_to(commands: Any) -> None:
    """Add its parser."""
    parser = commands.add_parser(
        'certificate', allow_abbrev=False, help='create or renew certificates for TLS',
        description='Create a certificate authority of your own and a certificate of the server, '
        'or renew the certificate.')
    parser.add_argument('word', nargs='?', choices=('make', 'check'), default='make',
                        help='create or renew (default), or check how long it is valid')
    parser.add_argument('--name', action='append', default=[], metavar='NAME',
                        help='host name or address of the server, as often as needed (default: '
                        'those of this machine, or those of the certificate that is renewed)')
    parser.add_argument('--days', type=int, default=certificates.SERVER_DAYS, metavar='N',
                        help='its validity (default: %(default)s, the longest)')
    parser.add_argument('--renew-authority', action='store_true',
                        help='create a new authority as well; each tablet must install it')
    parser.add_argument('--json', action='store_true', help='print JSON')
    add_where(parser)
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    folder = settings_of(arguments).where
    server = folder / certificates.SERVER_FILE
    if arguments.word == 'check':
        return _check(server, arguments.json)
    names = arguments.name or (certificates.names_of(server) if server.exists() else own_names())
    made = certificates.make(folder, names, days=arguments.days,
                             renew_authority=arguments.renew_authority)
    if arguments.json:
        print(json.dumps({'authority': str(made.authority), 'certificate': str(made.certificate),
                          'key': str(made.key), 'names': made.names,
                          'fingerprint': made.fingerprint, 'ends': made.ends.isoformat(),
                          'new_authority': made.is_new_authority}, indent=1))
        return OK
    print(f'{made.certificate} is valid for {", ".join(made.names)} until {made.ends:%Y-%m-%d}',
          f'start the monitor with --certificate {made.certificate} --key {made.key}', sep='\n')
    if made.is_new_authority:
        print(_INSTALL.format(authority=made.authority, fingerprint=made.fingerprint,
                              secret=folder / certificates.CA_KEY_FILE))
    else:
        print('the authority is unchanged: the tablets need no installation')
    return OK


def _check(path: Path, as_json: bool) -> int:
    days = certificates.days_left(path)
    is_due = days < certificates.RENEW_DAYS
    if as_json:
        print(json.dumps({'days_left': days, 'names': certificates.names_of(path),
                          'due': is_due}, indent=1))
    else:
        print(f'{path}: valid for {", ".join(certificates.names_of(path))}, {days:.0f} days left')
    return FAILED if is_due else OK


def own_names() -> list[str]:
    """Return the host name of this machine, and the address by which it reaches others."""
    host = socket.gethostname().lower()
    names = [host] if '.' in host else [host, f'{host}.local']
    # Nothing is sent: this only determines the source address.
    for family, target in ((socket.AF_INET, '192.0.2.1'), (socket.AF_INET6, '2001:db8::1')):
        try:
            with socket.socket(family, socket.SOCK_DGRAM) as probe:
                probe.connect((target, 9))
                names.append(str(probe.getsockname()[0]))
        except OSError:
            continue
    return [name for name in names if name]
