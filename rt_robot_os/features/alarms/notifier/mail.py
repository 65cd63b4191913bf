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

"""The channel `email`: a message by SMTP."""

from __future__ import annotations

from collections.abc import Mapping
from email.message import EmailMessage
from email.utils import formatdate
from pathlib import Path
import smtplib
import socket
import ssl
from typing import Any
from typing import Final

from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.features.alarms.notifier.channel import Deadline
from rt_robot_os.features.alarms.notifier.channel import DeliveryError
from rt_robot_os.features.alarms.notifier.channel import environment_value
from rt_robot_os.features.alarms.notifier.channel import GRACE_S
from rt_robot_os.features.alarms.notifier.channel import is_own_machine
from rt_robot_os.features.alarms.notifier.channel import VARIABLE
from rt_robot_os.features.alarms.notifier.webhook import idempotency_key
from rt_robot_os.features.alarms.notifier.wording import lines_of
from rt_robot_os.features.alarms.notifier.wording import title_of
from rt_robot_os.linux.folders import read_file
from rt_robot_os.messages.notification import Notification

_PICTURES_MOST: Final = 4
_PICTURE_BYTES: Final = 4 << 20
_PICTURES: Final = {'.jpg': 'jpeg', '.jpeg': 'jpeg', '.png': 'png'}


class _Server(smtplib.SMTP):
    """A connection with a deadline from its first byte."""

    def __init__(self, deadline: Deadline, *arguments: Any, **options: Any) -> None:
        self._deadline = deadline
        super().__init__(*arguments, **options)

    def _get_socket(self, host: str, port: int, timeout: float) -> socket.socket:
        made: socket.socket = super()._get_socket(host, port, timeout)  # type: ignore[misc]
        self._deadline.guard(made)
        return made


class _TlsServer(_Server, smtplib.SMTP_SSL):
    """The same, encrypted from its first byte."""


class MailChannel:
    """Send a message; it is delivered when the server has accepted it."""

    SETTINGS = (
        Field('server', str, REQUIRED, 'Server that sends the mail'),
        Field('port', int, 587, 'Its port', minimum=1, maximum=65535),
        Field('security', str, 'starttls', 'How the connection is encrypted; none only on this '
              'machine', choices=('starttls', 'tls', 'none')),
        Field('user', str, '', 'Name of the account; empty: without'),
        Field('password', str, '', 'Its password: $NAME of a variable of the environment; it '
              'cannot be written here'),
        Field('sender', str, REQUIRED, 'Address that the message comes from'),
        Field('to', list, REQUIRED, 'Addresses that it goes to'),
        Field('pictures', bool, True, 'Attach the pictures that the robot has taken'),
        Field('ca_file', str, '', 'Certificates to trust in place of those of the system',
              is_file=True))

    def __init__(self, values: Mapping[str, Any], environ: Mapping[str, str]) -> None:
        """
        Check the settings.

        :raises ValueError: with what is wrong with them.
        """
        self._values = values
        self._timeout_s = float(values['timeout_s'])
        self._password = ''
        for address in (values['sender'], *values['to']):
            if '@' not in address or not address.isprintable() or ' ' in address:
                raise ValueError(f'{address[:60]!r} is not an address: write name@example.org')
        if not values['to']:
            raise ValueError('to is empty: name an address')
        if values['security'] == 'none' and not is_own_machine(values['server']):
            raise ValueError(f'security: none to {values["server"]}: it can be read on '
                             'the network; use starttls or tls')
        if bool(values['user']) != bool(values['password']):
            raise ValueError('user and password go together')
        if values['password']:
            if not values['password'].startswith(VARIABLE):
                raise ValueError('password must be $NAME of a variable of the environment: a '
                                 'parameter file is no place for secrets')
            self._password = environment_value(values['password'], environ)
        try:
            self._tls = ssl.create_default_context(cafile=values['ca_file'] or None)
        except (OSError, ssl.SSLError) as error:
            raise ValueError(f'ca_file cannot be used: {error}') from error

    def deliver(self, notification: Notification, again: bool) -> str:
        """Send it; a repetition has the same Message-ID, which mail programs show once."""
        message = self._message(notification, again)
        deadline = Deadline(self._timeout_s)
        server = None
        try:
            with deadline.watch():
                server = self._connect(deadline)
                if self._values['security'] == 'starttls':
                    server.starttls(context=self._tls)
                    deadline.guard(server.sock)
                if self._password:
                    server.login(self._values['user'], self._password)
                refused = server.send_message(message)
        except (OSError, smtplib.SMTPException, ValueError) as error:
            why = f'not done in {self._timeout_s:g} s' if deadline.over or isinstance(
                error, TimeoutError) else self._said(error)
            raise DeliveryError(f'{self._values["server"]}: {why}') from None
        finally:
            if server is not None:
                server.close()  # without QUIT: the message was accepted
        if refused:
            return f'taken, but not for {len(refused)} of {len(self._values["to"])}'
        return f'{self._values["server"]} took it'

    def _connect(self, deadline: Deadline) -> smtplib.SMTP:
        server, port = self._values['server'], self._values['port']
        longest_s = self._timeout_s + GRACE_S
        if self._values['security'] == 'tls':
            return _TlsServer(deadline, server, port, timeout=longest_s, context=self._tls)
        return _Server(deadline, server, port, timeout=longest_s)

    def _message(self, notification: Notification, again: bool) -> EmailMessage:
        message = EmailMessage()
        message['Subject'] = title_of(notification)
        message['From'] = self._values['sender']
        message['To'] = ', '.join(self._values['to'])
        message['Date'] = formatdate(localtime=True)
        message['Message-ID'] = f'<{idempotency_key(notification.key)}@rt-robot-os.invalid>'
        message['Auto-Submitted'] = 'auto-generated'
        lines = lines_of(notification, again)
        attached: list[tuple[bytes, str, str]] = []
        for name in notification.pictures[:_PICTURES_MOST]:
            picture = _picture(Path(name)) if self._values['pictures'] else None
            if picture is not None:
                attached.append(picture)
            else:
                lines.append(f'picture: {safe_line(name)}')
        message.set_content('\n'.join(lines) + '\n')
        for data, kind, file in attached:
            message.add_attachment(data, maintype='image', subtype=kind, filename=file)
        return message

    def _said(self, error: Exception) -> str:
        """Return the answer of a server, without secrets."""
        if isinstance(error, smtplib.SMTPRecipientsRefused):
            text = f'refuses {", ".join(error.recipients)}'
        elif isinstance(error, smtplib.SMTPResponseException):
            said = error.smtp_error
            words = said.decode(errors='replace') if isinstance(said, bytes) else said
            text = f'{error.smtp_code} {words}'
        else:
            text = getattr(error, 'strerror', None) or str(error) or type(error).__name__
        return safe_line(text.replace(self._password, '***') if self._password else text, 60)


def _picture(path: Path) -> tuple[bytes, str, str] | None:
    """Read a picture that is to be attached; None when it is not one."""
    kind = _PICTURES.get(path.suffix.lower())
    if kind is None:
        return None
    try:
        return read_file(path, _PICTURE_BYTES), kind, safe_line(path.name, 80)
    except OSError:
        return None
