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

"""Records of a real core: each once at the server, whatever is restarted, cut or lost."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from typing import cast

from fake_server import FakeServer
from processes import wait_until
import pytest

pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')
pytest.importorskip('websockets', reason='websockets is not installed')

from rt_robot_os.gateway.part import Record  # noqa: E402
from rt_robot_os.gateway.reading import Sample  # noqa: E402
from rt_robot_os.gateway.records import Records  # noqa: E402
from rt_robot_os.messages.cdr import string_message  # noqa: E402
from rt_robot_os.messages.uplink.importance import Importance  # noqa: E402


def event(number: int, **more: Any) -> dict[str, Any]:
    return {'seq': number, 't_ns': number, 'alarm': '7', 'event': 'raised', 'state': 'raised',
            'level': 'critical', 'subject': 'anna', 'kinds': ['fall'], 'text': 'ünder', **more}


def numbers(server: FakeServer) -> list[int]:
    """Return the events that the server has, once for each time it stored one of them anew."""
    return [each['content']['seq'] for each in server.records('alarm_event')]


def test_each_event_is_recorded_once_over_restarts_of_gateway_and_core(
        core: Any, server: FakeServer, gateway: Any) -> None:
    with gateway(core):
        core.publish('alarms/events', event(1))
        wait_until(lambda: 1 in numbers(server), 'the first')
    core.publish('alarms/events', event(2))  # nobody hears it but the core's ring
    with gateway(core) as made:
        wait_until(lambda: 2 in numbers(server), 'the second')
        assert made.statistics()['recorded_before'] >= 1
        core.kill()
        core.start()
        core.publish('alarms/events', event(3))
        wait_until(lambda: 3 in numbers(server), 'one of the next core')
    assert sorted(each for each in numbers(server) if each <= 3) == [1, 2, 3]
    assert all(len(copies) == 1 for copies in server.stored.values())


def test_what_waits_goes_by_importance_and_each_once_although_answers_are_lost(
        core: Any, server: FakeServer, gateway: Any) -> None:
    server.stop()
    with gateway(core) as made:
        for number in range(600):
            made.keeper.keep(Record(Importance(number % 5), 'log', {'n': number}, number))
        wait_until(lambda: made.statistics()['waiting'] >= 600, 'records on the disk')
    server.drop_acks = 2
    with gateway(core, silence_s=0.5) as made:
        server.start()
        wait_until(lambda: server.drop_acks == 0, 'answers that are lost')
        server.cut()
        wait_until(lambda: made.statistics()['waiting'] == 0, 'all of them at the server')
        found = [each['content']['n'] for each in server.records('log') if 'n' in each['content']]
        assert sorted(found) == list(range(600))
        order = [importance for _, _, importance in server.order]
        assert order == sorted(order)
        assert any(len(copies) > 1 for copies in server.stored.values())  # known by their keys


def test_a_record_that_is_refused_blocks_no_other(
        core: Any, server: FakeServer, gateway: Any, tmp_path: Path) -> None:
    server.bad = {'poison'}
    said: list[str] = []
    with gateway(core, said) as made:
        for number in range(40):
            kind = 'poison' if number == 13 else 'log'
            made.keeper.keep(Record(Importance.OBSERVATION, kind, {'n': number}, number))
        wait_until(lambda: len([each for each in server.records('log')
                                if 'n' in each['content']]) == 39, 'all others')
        for number in range(100, 200):  # it is tried again when others were taken since
            made.keeper.keep(Record(Importance.OBSERVATION, 'log', {'n': number}, number))
            wait_until(lambda: any(each['content'].get('n') == number
                                   for each in server.records('log')), 'one more')
            if made.statistics()['set_aside']:
                break
        assert made.statistics()['set_aside'] == 1
        wait_until(lambda: any('it is set aside' in line for line in said), 'a word about it')
        wait_until(lambda: made.statistics()['waiting'] == 0, 'an empty outbox')
        json.dumps(made.statistics())


def test_a_measurement_is_one_observation_however_long_it_is_shown() -> None:
    kept: list[Record] = []
    keeper = SimpleNamespace(marks=dict, keep=kept.append)
    # Whatever is there is due again at once.
    settings = SimpleNamespace(observation_s=0.0, signs_s=0.0)
    records = Records(cast(Any, SimpleNamespace(settings=settings)), cast(Any, keeper))
    signs, = (each for each in records.reads() if each.topic.endswith('/signs'))

    def shown(value: str, quality: str, measured_ns: int, now_ns: int) -> None:
        cdr = string_message(json.dumps({'status': [{
            'level': 0, 'name': 'systolic_mmhg', 'message': '', 'hardware_id': '', 'values': {
                'value': value, 'quality': quality, 'source': 'cuff',
                'stamp_ns': str(measured_ns)}}]}))
        signs.take(Sample('health/anna/signs', 'std_msgs/msg/String', now_ns, 1, memoryview(cdr)))

    for now_ns in (10, 20, 30):
        shown('120', 'good', 5, now_ns)
    shown('120', 'good', 35, 40)  # measured again, and the same
    shown('120', 'stale', 35, 50)
    assert [(each.content['value'], each.content['quality']) for each in kept] == [
        (120.0, 'good'), (120.0, 'good'), (120.0, 'stale')]
