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

"""The channel `webhook`: HTTPS POST of JSON."""

from __future__ import annotations

from collections.abc import Mapping
import hashlib
from http.client import HTTPConnection
from http.client import HTTPException
from http.client import HTTPSConnection
import ssl
from typing import Any
from typing import Final
from urllib.parse import urlsplit

from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.features.alarms.notifier.channel import Deadline
from rt_robot_os.features.alarms.notifier.channel import DeliveryError
from rt_robot_os.features.alarms.notifier.channel import environment_value
from rt_robot_os.features.alarms.notifier.channel import GRACE_S
from rt_robot_os.features.alarms.notifier.channel import is_own_machine
from rt_robot_os.features.alarms.notifier.channel import VARIABLE
from rt_robot_os.features.alarms.notifier.wording import json_of
from rt_robot_os.messages.notification import Notification

_KEY_LETTERS: Final = 32


def idempotency_key(key: str) -> str:
    """Return a key as it is sent: short and without what a header cannot hold."""
    return hashlib.sha256(key.encode()).hexdigest()[:_KEY_LETTERS]


class WebhookChannel:
    """Send a POST request; a 2xx response means delivered, redirections are not followed."""

    SETTINGS = (
        Field('url', str, REQUIRED, 'https://... that takes a POST of JSON, or $NAME of a '
              'variable of the environment that holds it; http:// only on this machine'),
        Field('header', str, '', 'Name of a header with a secret, such as Authorization'),
        Field('secret', str, '', 'Value of that header: $NAME of a variable of the environment; '
              'it cannot be written here'),
        Field('ca_file', str, '', 'Certificates to trust in place of those of the system',
              is_file=True))

    def __init__(self, values: Mapping[str, Any], environ: Mapping[str, str]) -> None:
        """
        Check the settings.

        :raises ValueError: with what is wrong with them.
        """
        self._timeout_s = float(values['timeout_s'])
        url = environment_value(values['url'], environ)
        self._secrets = [url] if values['url'].startswith(VARIABLE) else []
        try:
            parts = urlsplit(url)
            self._host, self._port = parts.hostname or '', parts.port
        except ValueError:
            raise ValueError('url is not a URL: write https://host/path') from None
        if not self._host or parts.scheme not in ('https', 'http') or parts.username:
            raise ValueError('url must be https://host/path, without a user in it')
        if parts.scheme == 'http' and not is_own_machine(self._host):
            raise ValueError(f'url goes to {self._host} by http, which can be read on the '
                             'network: use https')
        self._path = (parts.path or '/') + (f'?{parts.query}' if parts.query else '')
        self._tls = self._context(values['ca_file']) if parts.scheme == 'https' else None
        self._headers = self._header(values['header'], values['secret'], environ)

    @staticmethod
    def _context(ca_file: str) -> ssl.SSLContext:
        try:
            return ssl.create_default_context(cafile=ca_file or None)
        except (OSError, ssl.SSLError) as error:
            raise ValueError(f'ca_file cannot be used: {error}') from error

    def _header(self, name: str, value: str, environ: Mapping[str, str]) -> dict[str, str]:
        if bool(name) != bool(value):
            raise ValueError('header and secret go together: the name of a header and its value')
        if not name:
            return {}
        if not value.startswith(VARIABLE):
            raise ValueError('secret must be $NAME of a variable of the environment: a parameter '
                             'file is no place for secrets')
        secret = environment_value(value, environ)
        if not secret.isprintable() or not secret.isascii() or not name.replace('-', '').isalnum():
            raise ValueError('header and secret must be what a header can hold')
        self._secrets.append(secret)
        return {name: secret}

    def deliver(self, notification: Notification, again: bool) -> str:
        """Send it; the header Idempotency-Key lets the receiver detect a repetition."""
        kind = HTTPConnection if self._tls is None else HTTPSConnection
        options: dict[str, Any] = {} if self._tls is None else {'context': self._tls}
        connection = kind(self._host, self._port, timeout=self._timeout_s + GRACE_S, **options)
        deadline = Deadline(self._timeout_s)
        try:
            with deadline.watch():
                connection.connect()
                deadline.guard(connection.sock)
                connection.request('POST', self._path, json_of(notification, again).encode(), {
                    'Content-Type': 'application/json', 'User-Agent': 'rt_robot_os notifier',
                    'Idempotency-Key': idempotency_key(notification.key), **self._headers})
                answer = connection.getresponse()
                answer.close()  # the body of the response does not matter
        except (OSError, HTTPException, ValueError) as error:
            why = f'no answer in {self._timeout_s:g} s' if deadline.over or isinstance(
                error, TimeoutError) else self._hidden(
                    getattr(error, 'strerror', None) or str(error) or type(error).__name__)
            raise DeliveryError(f'{self._host}: {why}') from None
        finally:
            connection.close()
        if 200 <= answer.status < 300:
            return f'{self._host} answered {answer.status}'
        if 300 <= answer.status < 400:
            raise DeliveryError(f'{self._host} answered {answer.status}: it redirects, which is '
                                'not followed; write the final url')
        raise DeliveryError(f'{self._host} answered {answer.status} {self._hidden(answer.reason)}')

    def _hidden(self, text: str) -> str:
        """Return a received text without secrets."""
        for secret in self._secrets:
            text = text.replace(secret, '***')
        return safe_line(text, 60)
