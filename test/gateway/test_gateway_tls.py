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

"""Who is let in, and who is believed: TLS, tokens, and words that name the remedy, once."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from datetime import timedelta
from datetime import timezone
from pathlib import Path
import ssl
from typing import Any

from fake_server import FakeServer
from fake_server import serving
from processes import wait_until
import pytest

cryptography = pytest.importorskip('cryptography', reason='cryptography is not installed')

from cryptography import x509  # noqa: E402, I100
from cryptography.hazmat.primitives import hashes  # noqa: E402
from cryptography.hazmat.primitives import serialization  # noqa: E402
from cryptography.hazmat.primitives.asymmetric import ec  # noqa: E402
from cryptography.x509.oid import NameOID  # noqa: E402

from rt_robot_os.base.errors import StartError  # noqa: E402
from rt_robot_os.gateway.settings import server_problem  # noqa: E402
from rt_robot_os.gateway.token import read_token  # noqa: E402


def certificate(folder: Path, name: str = 'localhost', days: int = 30) -> ssl.SSLContext:
    """Make a certificate that signs itself, and what a server presents it with."""
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    now = datetime.now(timezone.utc)
    made = (x509.CertificateBuilder().subject_name(subject).issuer_name(subject)
            .public_key(key.public_key()).serial_number(x509.random_serial_number())
            .not_valid_before(now - timedelta(days=60)).not_valid_after(now + timedelta(days=days))
            .add_extension(x509.SubjectAlternativeName([x509.DNSName(name)]), False)
            .add_extension(x509.BasicConstraints(ca=True, path_length=None), True)
            .sign(key, hashes.SHA256()))
    (folder / 'ca.pem').write_bytes(made.public_bytes(serialization.Encoding.PEM))
    (folder / 'key.pem').write_bytes(key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption()))
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(folder / 'ca.pem', folder / 'key.pem')
    return context


def told(core: Any, gateway: Any, said: list[str], word: str, **settings: Any) -> str:
    """Run a gateway until it has said something with a word in it, and give that line."""
    with gateway(core, said, **settings) as made:
        line = wait_until(lambda: next((each for each in said if word in each), None), word)
        assert not made.server.connected
        wait_until(lambda: made.statistics()['attempts'] > 2, 'more attempts')
        assert sum(word in each for each in said) == 1  # told once, however often it fails
    assert 'token-of-the-robot' not in ''.join(said)
    return str(line)


def test_a_certificate_that_is_trusted_is_taken(
        core: Any, tmp_path: Path, gateway: Any) -> None:
    with serving(FakeServer(tls=certificate(tmp_path))) as server:
        with gateway(core, url=server.url, ca_file=str(tmp_path / 'ca.pem')) as made:
            wait_until(lambda: made.server.connected, 'a connection by TLS')


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Have refusals tried again at once."""
    monkeypatch.setattr('rt_robot_os.gateway.connection.REFUSED_S', 0.05)
    return lambda: None


@pytest.mark.parametrize(('name', 'days', 'trusted', 'word', 'remedy'), [
    ('localhost', 30, False, 'not signed by', 'ca_file'),
    ('localhost', -1, True, 'has expired', 'monitor certificate'),
    ('elsewhere', 30, True, 'for another name', 'write the name that is in it')])
def test_a_certificate_that_is_wrong_is_told_once_with_the_remedy(  # noqa: CFQ002
        core: Any, tmp_path: Path, gateway: Any, impatient: Any, name: str, days: int,
        trusted: bool, word: str, remedy: str) -> None:
    said: list[str] = []
    with serving(FakeServer(tls=certificate(tmp_path, name, days))) as server:
        more = {'ca_file': str(tmp_path / 'ca.pem')} if trusted else {}
        line = told(core, gateway, said, word, url=server.url, **more)
        assert remedy in line and not server.paths


def test_a_wrong_token_is_told_and_a_right_one_is_taken_without_a_restart(
        core: Any, tmp_path: Path, gateway: Any, impatient: Any) -> None:
    said: list[str] = []
    with serving(FakeServer(token='another-token-of-a-robot')) as server:
        line = told(core, gateway, said, 'does not accept the token', url=server.url)
        assert 'monitor robot add' in line and str(tmp_path / 'token') in line
        assert all('token' not in path for path in server.paths)
        with gateway(core, said, url=server.url) as made:
            (tmp_path / 'token').write_text('another-token-of-a-robot')
            wait_until(lambda: made.server.connected, 'a connection with the right one')


@pytest.mark.parametrize(('text', 'mode', 'wrong'), [
    ('a-good-token-0123', 0o644, 'chmod 600'), ('a-good-token-0123', 0o620, 'chmod 600'),
    ('short', 0o600, 'holds no token'), ('with a space in it', 0o600, 'holds no token'),
    ('', 0o600, 'holds no token')])
def test_a_token_that_others_can_read_is_refused(
        tmp_path: Path, text: str, mode: int, wrong: str) -> None:
    path = tmp_path / 'token'
    path.write_text(text)
    path.chmod(mode)
    with pytest.raises(StartError, match=wrong) as caught:
        read_token(str(path))
    assert not text or text not in str(caught.value)


@pytest.mark.parametrize('server', [
    'https://host', 'wss://', 'ws://host:1', 'wss://user:secret@host', 'wss://host/?token=x',
    'wss://host:99999', 'host:8443', 'ws://127.0.0.1.evil.example'])
def test_an_address_that_is_none_or_not_safe_is_refused(server: str) -> None:
    assert server_problem(server)


@pytest.mark.parametrize('server', [
    'wss://host', 'wss://host:8443', 'ws://localhost:8080', 'ws://127.0.0.1:1', 'ws://[::1]:80'])
def test_a_safe_address_is_taken(server: str) -> None:
    assert not server_problem(server)
