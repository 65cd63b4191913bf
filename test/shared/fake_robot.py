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

"""
A robot as the server of the monitor sees it: says hello, sends what it is told, does commands.

For tests in threads: it runs in one of its own. ``RobotScript`` has the messages without a
network, for tests that bring their own.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Mapping
from contextlib import ExitStack
from contextlib import suppress
import itertools
import threading
import time
from typing import Any
import uuid

from rt_robot_os.messages.uplink.importance import Importance
from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.messages.uplink.messages import encode
from websockets.exceptions import ConnectionClosed


def token_of(name: str) -> str:
    """Return the token of a robot of the tests; one that is real nobody could guess."""
    return name.ljust(43, '-')


class RobotScript:
    """The messages of a robot, numbered as they have to be."""

    def __init__(self, robot: str = 'robot', people: tuple[str, ...] = ('anna',),
                 boot: str = '', **about: Any) -> None:
        self.robot = robot
        self.people = people
        self.boot = boot or uuid.uuid4().hex
        self.about = about
        self._live = itertools.count(1)
        self._batch = itertools.count(1)
        self._seq = itertools.count(1)
        self._event = itertools.count(1)

    def hello(self) -> str:
        """Return what comes first."""
        return encode('hello', {'version': 1, 'robot': self.robot, 'name': self.robot,
                                'boot': self.boot, 'utc_ns': time.time_ns(),
                                'people': list(self.people), 'cameras': [], 'capabilities': [],
                                'nodes': [], 'map': None, 'limits': {}, **self.about})

    def live(self, signals: Mapping[str, Any]) -> str:
        """Return signals as they are now."""
        now_ns = time.time_ns()
        return encode('live', {'n': next(self._live), 'utc_ns': now_ns, 'signals': {
            name: [now_ns, value] for name, value in signals.items()}})

    def record(self, type_: str, content: Mapping[str, Any],
               importance: Importance = Importance.OBSERVATION) -> dict[str, Any]:
        """Return a record with the next number."""
        return {'seq': next(self._seq), 'importance': int(importance), 'type': type_,
                'utc_ns': time.time_ns(), 'content': dict(content)}

    def records(self, *records: Mapping[str, Any]) -> str:
        """Return a batch of them."""
        return encode('records', {'batch': next(self._batch), 'records': list(records),
                                  'lost': {}})

    def alarm(self, alarm: str, event: str = 'raised', state: str = 'raised',
              subject: str = 'anna', level: str = 'critical', text: str = '', **more: Any
              ) -> dict[str, Any]:
        """Return the record of an event in an alarm's life."""
        return self.record('alarm_event', {
            'seq': next(self._event), 't_ns': time.monotonic_ns(), 'alarm': alarm, 'event': event,
            'state': state, 'level': level, 'subject': subject, 'kinds': ['fall'],
            'text': text or f'{subject} lies in the hall', 'by': '', 'why': '', **more},
            Importance.ALARM)

    def observation(self, person: str, sign: str, value: float) -> dict[str, Any]:
        """Return the record of a vital sign."""
        return self.record('observation', {'person': person, 'sign': sign, 'value': value,
                                           'quality': 'good', 'source': 'belt'})


class FakeRobot:
    """
    A robot that is connected to a server, in a thread of its own.

    :param url: such as ``ws://127.0.0.1:8080``.
    :param token: of the robot; that of the tests when there is none.
    :param answer: makes the answer to a command: ``(ok, text)``.
    :ivar received: what came, the newest last.
    """

    def __init__(self, url: str, token: str = '', script: RobotScript | None = None,
                 answer: Callable[[dict[str, Any]], tuple[bool, str]] | None = None,
                 **options: Any) -> None:
        self.script = script or RobotScript()
        self.received: deque[dict[str, Any]] = deque(maxlen=10_000)
        self.commands: list[dict[str, Any]] = []
        self._answer = answer or (lambda command: (True, 'done'))
        self._url = url
        self._token = token or token_of(self.script.robot)
        self._options = {'open_timeout': 60.0, **options}  # other tests keep the machine busy
        self._came = threading.Condition()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> FakeRobot:
        """Connect and say hello."""
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        """Disconnect."""
        self.disconnect()

    def connect(self) -> None:
        """Connect and say hello; return when it has been welcomed."""
        from websockets.sync.client import connect
        self._stack = ExitStack()
        self._socket = self._stack.enter_context(connect(
            f'{self._url}/robot/state', compression=None, proxy=None,
            additional_headers={'Authorization': f'Bearer {self._token}'}, **self._options))
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()
        before = len(self.received)
        self._socket.send(self.script.hello())
        self.wait_for('welcome', since=before)

    def disconnect(self) -> None:
        """Close the connection."""
        self._stack.close()
        if self._thread is not None:
            self._thread.join(10)

    def send(self, text: str) -> None:
        """Send a message."""
        self._socket.send(text)

    def live(self, **signals: Any) -> None:
        """Send signals; in their names ``__`` stands for a slash."""
        self.send(self.script.live({name.replace('__', '/'): value
                                    for name, value in signals.items()}))

    def raise_alarm(self, alarm: str = 'a1', **more: Any) -> None:
        """Raise an alarm, or tell of another event of it; return when it is stored."""
        self.keep(self.script.alarm(alarm, **more))

    def keep(self, *records: Mapping[str, Any]) -> None:
        """Send records; return when the server has stored them."""
        text = self.script.records(*records)
        before = len(self.received)
        self.send(text)
        self.wait_for('stored', since=before, batch=decode(text)['batch'])

    def wait_for(self, kind: str, since: int = 0, patience_s: float = 20.0, **content: Any
                 ) -> dict[str, Any]:
        """Return the next message of a kind with such a content."""
        def found() -> dict[str, Any] | None:
            return next((each for each in itertools.islice(self.received, since, None)
                         if each['kind'] == kind and content.items() <= each.items()), None)

        with self._came:
            if not self._came.wait_for(lambda: found() is not None, patience_s):
                raise TimeoutError(f'no {kind} {content} of the server; there came '
                                   f'{[each["kind"] for each in self.received]}')
            return found() or {}

    def _read(self) -> None:
        with suppress(ConnectionClosed):  # by a server that ends
            self._hear()

    def _hear(self) -> None:
        for text in self._socket:
            message = decode(text)
            with self._came:
                self.received.append(message)
                self._came.notify_all()
            if message['kind'] == 'command':
                self.commands.append(message)
                ok, said = self._answer(message)
                with suppress(ConnectionClosed):  # nobody waits for it any more
                    self.send(encode('answer', {'id': message['id'], 'ok': ok, 'text': said}))
