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

"""Each channel over real sockets, files and programs: delivered, refused, too slow, twice."""

from __future__ import annotations

from collections.abc import Iterator
from email import message_from_string
import json
from pathlib import Path
import shutil
import ssl
import subprocess
import sys
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.alarms.notifier.channel import Channel
from rt_robot_os.features.alarms.notifier.channel import DeliveryError
from rt_robot_os.features.alarms.notifier.settings import load
from rt_robot_os.messages.notification import Notification
from small_servers import Post
from small_servers import serving
from small_servers import Web

FALL = {'key': '7.1.0.0.operator', 'channel': 'operator', 'alarm': '7', 'step': 0,
        'level': 'critical', 'subject': 'anna', 'text': 'anna fell in the bathroom',
        'kinds': ['fall', 'help'], 'node': 'wrist', 'x': 1.5, 'y': 2.0}
ENVIRON = {'TOKEN': 'Bearer 4711', 'PASSWORD': 'sesame', 'PATH': '/usr/bin:/bin'}
GENEROUS_S = 30.0


def fall(**more: Any) -> Notification:
    return Notification.from_json(json.dumps({**FALL, **more}))


def channel(tmp_path: Path, kind: str, **values: Any) -> Channel:
    path = tmp_path / 'notifier.yaml'
    path.write_text(json.dumps({'/**/notifier': {'ros__parameters': {
        'channels': ['operator'],
        'operator': {'type': kind, 'timeout_s': GENEROUS_S, **values}}}}))
    return load([path], {}, ENVIRON).channels[0].channel


# ---- on this machine -------------------------------------------------------------------------

def test_the_console_gets_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = channel(tmp_path, 'console')
    made.deliver(fall(), False)
    made.deliver(fall(text='a\x1b[2Jb\nc'), True)
    first, second = capsys.readouterr().out.splitlines()
    assert first.endswith(' anna fell in the bathroom')
    assert '\x1b' not in second and second.endswith('c (perhaps again)')


def test_a_file_gets_a_line_once(tmp_path: Path) -> None:
    path = tmp_path / 'calls.jsonl'
    made = channel(tmp_path, 'file', path=str(path))
    made.deliver(fall(), False)
    assert made.deliver(fall(), True) == 'was written before'
    with path.open('ab') as file:
        file.write(b'{"at": "cut')
    made.deliver(fall(key='7.1.0.1.operator'), True)
    lines = path.read_text().splitlines()
    assert [json.loads(line)['key'] for line in (lines[0], lines[2])] == [
        '7.1.0.0.operator', '7.1.0.1.operator']
    assert path.stat().st_mode & 0o777 == 0o600
    path.unlink()
    path.mkdir()
    with pytest.raises(DeliveryError, match='calls.jsonl: Is a directory'):
        made.deliver(fall(), False)


def test_a_program_gets_json_and_its_exit_code_counts(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = tmp_path / 'found.json'
    code = (f'import json, os, sys; found = json.load(sys.stdin); open({str(found)!r}, "w").write('
            'json.dumps([found, "TOKEN" in os.environ])); sys.exit(found["step"])')
    made = channel(tmp_path, 'command', command=[sys.executable, '-c', code])
    made.deliver(fall(), True)
    content, _ = json.loads(found.read_text())
    assert content == {**FALL, 'title': 'CRITICAL anna: fall, help', 'again': True}
    with pytest.raises(DeliveryError, match='ended with code 3'):
        made.deliver(fall(step=3), False)
    with pytest.raises(DeliveryError, match='no-such-program: No such file'):
        channel(tmp_path, 'command', command=['/no-such-program']).deliver(fall(), False)
    slow = channel(tmp_path, 'command', command=['sh', '-c', 'sleep 60 & sleep 60'],
                   timeout_s=0.1)
    with pytest.raises(DeliveryError, match='not done in 0.1 s'):
        slow.deliver(fall(), False)


def test_a_program_does_not_see_the_secrets_of_other_channels(tmp_path: Path) -> None:
    found = tmp_path / 'found'
    path = tmp_path / 'notifier.yaml'
    path.write_text(json.dumps({'/**/notifier': {'ros__parameters': {
        'channels': ['page', 'web'],
        'page': {'type': 'command', 'command': ['sh', '-c', f'env > {found}']},
        'web': {'type': 'webhook', 'url': 'https://example.org', 'header': 'Authorization',
                'secret': '$TOKEN'}}}}))
    load([path], {}, ENVIRON).channels[0].channel.deliver(fall(), False)
    assert 'PATH=' in found.read_text() and '4711' not in found.read_text()


# ---- over the web ----------------------------------------------------------------------------

@pytest.fixture
def web() -> Iterator[Web]:
    with serving(Web()) as made:
        assert isinstance(made, Web)
        yield made
        made.wait.set()
        made.drip = None


def test_a_webhook_gets_json_its_secret_and_the_same_key_again(web: Web, tmp_path: Path) -> None:
    made = channel(tmp_path, 'webhook', url=f'{web.url}/alarm?house=3', header='Authorization',
                   secret='$TOKEN')
    assert made.deliver(fall(), False) == '127.0.0.1 answered 204'
    made.deliver(fall(), True)
    made.deliver(fall(key='8.1'), False)
    (path, headers, content), (_, again, _), (_, other, _) = web.posts
    assert path == '/alarm?house=3' and content['kinds'] == ['fall', 'help']
    assert headers['Authorization'] == 'Bearer 4711'
    assert headers['Idempotency-Key'] == again['Idempotency-Key'] != other['Idempotency-Key']


def test_what_a_webhook_refuses_is_not_delivered(web: Web, tmp_path: Path) -> None:
    made = channel(tmp_path, 'webhook', url=web.url, header='Authorization', secret='$TOKEN')
    web.status, web.reason = 500, 'no Bearer 4711 here'
    with pytest.raises(DeliveryError) as refused:
        made.deliver(fall(), False)
    assert str(refused.value) == '127.0.0.1 answered 500 no *** here'
    web.status, web.headers = 302, {'Location': f'{web.url}/elsewhere'}
    with pytest.raises(DeliveryError, match='302: it redirects, which is not followed'):
        made.deliver(fall(), False)
    assert [path for path, _, _ in web.posts] == ['/', '/']


def test_a_webhook_that_answers_too_late_or_a_byte_at_a_time_is_left(
        web: Web, tmp_path: Path) -> None:
    made = channel(tmp_path, 'webhook', url=web.url, timeout_s=0.15)
    web.wait.clear()
    with pytest.raises(DeliveryError, match='no answer in 0.15 s'):
        made.deliver(fall(), False)
    web.wait.set()
    web.drip = lambda: b'H'
    with pytest.raises(DeliveryError, match='no answer in 0.15 s'):
        made.deliver(fall(), False)


def test_a_webhook_that_is_not_there_is_told(tmp_path: Path) -> None:
    with serving(Web()) as gone:
        url = gone.url  # type: ignore[attr-defined]
    with pytest.raises(DeliveryError, match='127.0.0.1: Connection refused'):
        channel(tmp_path, 'webhook', url=url).deliver(fall(), False)


# ---- by mail ---------------------------------------------------------------------------------

@pytest.fixture
def post() -> Iterator[Post]:
    with serving(Post()) as made:
        assert isinstance(made, Post)
        yield made


def mail(tmp_path: Path, post: Post, **more: Any) -> Channel:
    return channel(tmp_path, 'email', **{
        'server': '127.0.0.1', 'port': post.server_address[1], 'security': 'none',
        'user': 'robot', 'password': '$PASSWORD', 'sender': 'robot@example.org',
        'to': ['mary@example.org', 'night@example.org'], **more})


def test_a_mail_says_what_happened_and_shows_the_pictures(post: Post, tmp_path: Path) -> None:
    picture = tmp_path / 'bath.jpg'
    picture.write_bytes(b'\xff\xd8 a picture')
    (tmp_path / 'secret.txt').write_text('not a picture')
    made = mail(tmp_path, post)
    pictures = [str(picture), str(tmp_path / 'secret.txt'), '/no/such.jpg']
    made.deliver(fall(pictures=pictures), False)
    made.deliver(fall(pictures=pictures, subject='a\nBcc: x@example.org'), True)
    (sender, receivers, first), (_, _, second) = post.mails
    assert sender == '<robot@example.org>' and receivers == ['mary@example.org',
                                                             'night@example.org']
    message, again = message_from_string(first), message_from_string(second)
    assert message['Subject'] == 'CRITICAL anna: fall, help'
    assert message['Message-ID'] == again['Message-ID'] and again['Bcc'] is None
    text, attached = message.get_payload()  # type: ignore[misc]
    assert 'anna fell in the bathroom' in text.get_payload()  # type: ignore[union-attr]
    assert 'place: x 1.5 m, y 2.0 m' in text.get_payload()  # type: ignore[union-attr]
    assert 'not a picture' not in first and '/no/such.jpg' in first
    assert attached.get_payload(decode=True) == b'\xff\xd8 a picture'  # type: ignore[union-attr]


def test_a_mail_that_is_refused_says_why_without_the_password(post: Post, tmp_path: Path) -> None:
    post.refuse = '535 sesame is wrong'
    with pytest.raises(DeliveryError, match=r'127.0.0.1: 535 \*\*\* is wrong'):
        mail(tmp_path, post).deliver(fall(), False)
    post.refuse, post.refused = '', {'mary@example.org'}
    assert mail(tmp_path, post).deliver(fall(), False) == 'taken, but not for 1 of 2'
    post.refused.add('night@example.org')
    with pytest.raises(DeliveryError, match='refuses mary@example.org, night@example.org'):
        mail(tmp_path, post).deliver(fall(), False)
    post.greet = False
    with pytest.raises(DeliveryError, match='not done in 0.15 s'):
        mail(tmp_path, post, timeout_s=0.15).deliver(fall(), False)
    with pytest.raises(DeliveryError, match='STARTTLS'):
        post.greet = True
        mail(tmp_path, post, security='starttls').deliver(fall(), False)


def test_who_has_no_good_certificate_is_told_nothing(tmp_path: Path, web: Web, post: Post) -> None:
    openssl = shutil.which('openssl')
    if openssl is None:
        pytest.skip('openssl is not installed')
    key, certificate = str(tmp_path / 'key.pem'), str(tmp_path / 'certificate.pem')
    subprocess.run([openssl, 'req', '-x509', '-newkey', 'ec', '-pkeyopt',
                    'ec_paramgen_curve:prime256v1', '-nodes', '-keyout', key, '-out', certificate,
                    '-subj', '/CN=localhost', '-addext', 'subjectAltName=DNS:localhost'],
                   check=True, capture_output=True)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate, key)
    for server in (web, post):
        server.socket = context.wrap_socket(server.socket, server_side=True)
    url = f'https://localhost:{web.server_address[1]}/'
    for more in ({}, {'ca_file': certificate}):
        made = (channel(tmp_path, 'webhook', url=url, **more),
                mail(tmp_path, post, server='localhost', security='tls', **more))
        for each in made:
            if more:
                each.deliver(fall(), False)
            else:
                with pytest.raises(DeliveryError, match='CERTIFICATE_VERIFY_FAILED'):
                    each.deliver(fall(), False)
    assert len(web.posts) == len(post.mails) == 1


# ---- settings --------------------------------------------------------------------------------

@pytest.mark.parametrize(('kind', 'values', 'problem'), [
    ('pigeon', {}, 'operator.type = .*must be one of console, file, command, webhook, email'),
    ('file', {}, 'operator.path is missing'),
    ('file', {'path': 'x', 'paht': 'y'}, 'operator.paht: unknown key'),
    ('command', {'command': []}, 'operator: command is empty'),
    ('webhook', {'url': 'http://example.org'}, 'which can be read on the network'),
    ('webhook', {'url': 'ftp://example.org'}, 'url must be https://host/path'),
    ('webhook', {'url': 'https://me:you@example.org'}, 'without a user in it'),
    ('webhook', {'url': 'https://x', 'header': 'Authorization', 'secret': 'Bearer 4711'},
     'a parameter file is no place for secrets'),
    ('webhook', {'url': 'https://x', 'header': 'A', 'secret': '$NOBODY'},
     'the environment has no variable NOBODY'),
    ('webhook', {'url': 'https://x', 'header': 'A'}, 'header and secret go together'),
    ('webhook', {'url': 'https://x', 'ca_file': '/no/such.pem'}, 'ca_file cannot be used'),
    ('webhook', {'url': 'https://x', 'timeout_s': 0}, 'operator.timeout_s = 0'),
    ('email', {'server': 'mail.example.org', 'sender': 'a@b', 'to': ['c@d'], 'security': 'none'},
     'it can be read on the network'),
    ('email', {'server': 'x', 'sender': 'a@b', 'to': ['c@d'], 'user': 'a', 'password': 'sesame'},
     'no place for secrets'),
    ('email', {'server': 'x', 'sender': 'a@b', 'to': ['mary']}, "'mary' is not an address"),
    ('email', {'server': 'x', 'sender': 'a@b', 'to': []}, 'to is empty')])
def test_wrong_settings_are_told_before_anything_is_carried(
        tmp_path: Path, kind: str, values: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem) as found:
        channel(tmp_path, kind, **values)
    assert 'sesame' not in str(found.value) and '4711' not in str(found.value)


def test_the_example_of_the_page_can_be_used(tmp_path: Path) -> None:
    page = (Path(__file__).resolve().parents[3] / 'docs' / 'notifier.md').read_text()
    (tmp_path / 'notifier.yaml').write_text(page.partition('```yaml\n')[2].partition('```')[0])
    environ = {'OPERATOR_TOKEN': 'a', 'FAMILY_PASSWORD': 'b'}
    found = load([tmp_path / 'notifier.yaml'], {}, environ).channels
    assert [(each.name, each.type) for each in found] == [
        ('operator', 'webhook'), ('family', 'email'), ('diary', 'file')]


def test_sections_and_names_that_do_not_fit_are_told(tmp_path: Path) -> None:
    path = tmp_path / 'notifier.yaml'
    path.write_text(json.dumps({'/**/notifier': {'ros__parameters': {
        'channels': ['robot', 'Operator', 'family'], 'other': {'type': 'console'}}}}))
    with pytest.raises(ConfigError) as found:
        load([path], {}, ENVIRON)
    told = '\n'.join(found.value.problems)
    assert all(text in told for text in (
        "channels = 'robot': a channel is named", "channels = 'Operator'", 'other: this section',
        "channels = 'family': has no section: write family: {type: console}"))


@pytest.mark.parametrize('text', ['', '[]', '{"key": ""}', '{"key": "a\\n", "channel": "b"}',
                                  '{"key": "a", "channel": 7}', '[' * 100_000])
def test_what_is_no_notification_is_told(text: str) -> None:
    with pytest.raises(ValueError):
        Notification.from_json(text)
