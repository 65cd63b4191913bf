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

"""Follow the events of alarms, from one core to the next."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
import sys
import time

from rt_robot_os.base.programs import warn
from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.features.alarms.cli.client import check_topics
from rt_robot_os.features.alarms.cli.client import EVENTS
from rt_robot_os.features.alarms.cli.table import event_line
from rt_robot_os.link.client import LinkClient
from rt_robot_os.link.reconnecting_client import ReconnectingClient
from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.cdr import string_in
from rt_robot_os.messages.fields import parse_object

_PUMP_S = 0.2
_SHOWN = 60


def watch(path: Path, as_json: bool, stopping: Callable[[], bool] = lambda: False) -> None:
    """
    Print one event per line until stopped.

    :param path: of the core's socket.
    :param as_json: as JSON; else in words.
    """
    behind_ns = time.time_ns() - time.monotonic_ns()

    def take(stamp_ns: int, missed: int, cdr: memoryview) -> None:
        text = string_in(cdr)
        print(_as_json(text) if as_json else _as_line(text, behind_ns), flush=True)

    def connect(client: LinkClient) -> None:
        check_topics(client, EVENTS)
        client.sample_handlers[client.topics[EVENTS].channel] = take
        # Events of before the first connection are history; those of a new core are not.
        client.mirror(EVENTS, patient=True, oldest=connection.connections > 0)

    def say(text: str) -> None:
        warn('alarms', text)

    connection = ReconnectingClient(path, 'alarms', connect, say)
    try:
        while not stopping():
            connection.pump(_PUMP_S)
            sys.stdout.flush()
    finally:
        connection.close()


def _as_json(text: str) -> str:
    try:
        return json.dumps(parse_object(text, ''))
    except ValueError:
        return json.dumps({'event': 'unreadable', 'why': text[:_SHOWN]})


def _as_line(text: str, behind_ns: int) -> str:
    try:
        return event_line(AlarmEvent.from_json(text), behind_ns)
    except ValueError as error:
        return f'unreadable event: {safe_line(str(error))}'
