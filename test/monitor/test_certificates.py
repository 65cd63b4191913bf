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

"""Certificates of one's own: browsers and gateways take them, and their keys stay private."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from datetime import timedelta
from datetime import timezone
from pathlib import Path
import socket
import ssl
import threading

import pytest

pytest.importorskip('cryptography')

from cryptography import x509  # noqa: E402, I100
from cryptography.x509.oid import ExtendedKeyUsageOID  # noqa: E402
from rt_robot_os.base.errors import StartError  # noqa: E402
from rt_robot_os.monitor.security import certificates  # noqa: E402
from rt_robot_os.monitor.security.certificates import Certificate  # noqa: E402
from rt_robot_os.monitor.security.certificates import make  # noqa: E402

NAMES = ('monitor.local', '192.168.1.7')


@contextmanager
def listening(made: Certificate) -> Iterator[int]:
    """Serve TLS with it; give the port."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(made.certificate, made.key)
    with socket.create_server(('127.0.0.1', 0)) as server:
        def serve() -> None:
            while True:
                try:
                    peer, _ = server.accept()
                except OSError:
                    return
                with peer:
                    try:
                        context.wrap_socket(peer, server_side=True).close()
                    except OSError:
                        continue

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield server.getsockname()[1]
        server.shutdown(socket.SHUT_RDWR)
    thread.join(10)


def reach(port: int, name: str, authority: Path | None) -> None:
    """
    Connect as a browser does.

    :raises ssl.SSLError: the certificate is not taken.
    """
    context = ssl.create_default_context(cafile=str(authority) if authority else None)
    with socket.create_connection(('127.0.0.1', port), 10) as plain:
        context.wrap_socket(plain, server_hostname=name).close()


def test_a_client_that_has_the_authority_takes_the_server_by_each_name(tmp_path: Path) -> None:
    made = make(tmp_path / 'tls', NAMES)
    assert made.names == (*NAMES, 'localhost', '127.0.0.1', '::1') and made.is_new_authority
    with listening(made) as port:
        for name in made.names:
            reach(port, name, made.authority)
        with pytest.raises(ssl.SSLCertVerificationError):
            reach(port, 'other.local', made.authority)
        with pytest.raises(ssl.SSLCertVerificationError):
            reach(port, 'localhost', None)


def test_keys_are_for_their_owner_alone_and_say_what_they_are_for(tmp_path: Path) -> None:
    folder = tmp_path / 'tls'
    make(folder, NAMES)
    modes = {path.name: path.stat().st_mode & 0o777 for path in folder.iterdir()}
    assert modes == {'ca.key': 0o600, 'server.key': 0o600, 'ca.pem': 0o644, 'server.pem': 0o644}
    assert folder.stat().st_mode & 0o777 == 0o700
    server, authority = x509.load_pem_x509_certificates((folder / 'server.pem').read_bytes())
    assert authority.extensions.get_extension_for_class(x509.BasicConstraints).value.path_length \
        == 0
    assert not server.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    usage = server.extensions.get_extension_for_class(x509.KeyUsage)
    assert usage.critical and usage.value.digital_signature and not usage.value.key_cert_sign
    assert list(server.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value) == [
        ExtendedKeyUsageOID.SERVER_AUTH]
    lasts = server.not_valid_after_utc - server.not_valid_before_utc
    assert lasts <= timedelta(days=398)


def test_the_server_is_renewed_without_a_new_authority(tmp_path: Path) -> None:
    first = make(tmp_path, NAMES, days=20)
    before = first.key.read_bytes()
    assert certificates.days_left(first.certificate) < certificates.RENEW_DAYS
    again = make(tmp_path, certificates.names_of(first.certificate))
    assert again.names == first.names and not again.is_new_authority
    assert again.fingerprint == first.fingerprint and again.key.read_bytes() != before
    assert certificates.days_left(again.certificate) > 390
    with listening(again) as port:
        reach(port, 'monitor.local', first.authority)


def test_the_authority_vouches_for_no_name_of_the_world(tmp_path: Path) -> None:
    """Whoever steals its key must not be the bank of those who installed it."""
    made = make(tmp_path, NAMES)
    for name in ('example.org', '8.8.8.8', '2001:db8::1', 'notlocal'):
        with pytest.raises(StartError, match='may not certify'):
            make(tmp_path, [name])
    assert certificates.names_of(made.certificate)[0] == 'monitor.local'
    # What a thief would do: sign it all the same. No client takes that.
    entries = certificates._entries(['example.org'])
    authority, key = certificates._read_authority(tmp_path, datetime.now(timezone.utc))
    own = certificates.ec.generate_private_key(certificates.ec.SECP256R1())
    now = datetime.now(timezone.utc)
    forged = certificates._server(authority, key, own, entries, now, now + timedelta(days=1))
    made.certificate.write_bytes(certificates._pem(forged) + certificates._pem(authority))
    made.key.write_bytes(certificates._key_bytes(own))
    with listening(made) as port:
        with pytest.raises(ssl.SSLCertVerificationError):
            reach(port, 'example.org', made.authority)
    renewed = make(tmp_path, ['example.org'], renew_authority=True)
    assert renewed.is_new_authority and renewed.fingerprint != made.fingerprint


@pytest.mark.parametrize('name', ['', 'a b', '-x', 'x' * 300, '1.2.3', '*.local', 'a\nb',
                                  'http://monitor.local', 'ä.local'])
def test_what_is_no_name_is_told(tmp_path: Path, name: str) -> None:
    with pytest.raises(StartError, match='neither a host name nor an address'):
        make(tmp_path / 'tls', [name])
    assert not (tmp_path / 'tls').exists()


def test_what_is_broken_is_told_and_not_overwritten(tmp_path: Path) -> None:
    make(tmp_path, NAMES)
    (tmp_path / 'ca.key').write_text('nothing')
    with pytest.raises(StartError, match='ca.key'):
        make(tmp_path, NAMES)
    other = make(tmp_path / 'other', NAMES)
    (tmp_path / 'ca.key').write_bytes((other.authority.parent / 'ca.key').read_bytes())
    with pytest.raises(StartError, match='is not the key of'):
        make(tmp_path, NAMES)
    with pytest.raises(StartError, match='has expired'):
        make(tmp_path / 'other', NAMES, now=datetime.now(timezone.utc) + timedelta(days=4000))
    with pytest.raises(StartError, match='--days'):
        make(tmp_path / 'other', NAMES, days=4000)
    with pytest.raises(StartError):
        certificates.days_left(tmp_path / 'ca.key')


def test_the_address_that_is_printed_can_be_opened(tmp_path: Path) -> None:
    """A server on all addresses says a name of its certificate, and not 0.0.0.0."""
    pytest.importorskip('fastapi')
    from rt_robot_os.monitor.server import address
    from rt_robot_os.monitor.settings import MonitorSettings
    made = make(tmp_path, NAMES)
    settings = MonitorSettings(host='0.0.0.0', certificate=str(made.certificate),
                               key=str(made.key))
    with socket.create_server(('127.0.0.1', 0)) as taken:
        port = taken.getsockname()[1]
        assert address(settings, taken) == f'https://monitor.local:{port}'
        assert address(settings, taken, 'localhost') == f'https://localhost:{port}'
