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

"""Whatever the assisted living robot loses is a technical alarm of its own."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random

import pytest

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.settings.load import load_from_arguments
from rt_robot_os.tools.rehearse.fixture import CoreFixture
from rt_robot_os.tools.rehearse.journal_device import JournalDevice

pytest.importorskip('std_msgs.msg', reason='the ROS 2 messages are not installed')

CONFIG = Path(__file__).resolve().parents[2] / 'config' / 'assisted_living.yaml'
FULL_NS = 30 * NS_PER_S


class Silence:
    """Publishes nothing but a battery that runs down, and hears which alarms are raised."""

    def __init__(self) -> None:
        self.raised: dict[str, tuple[str, str, str]] = {}

    def attach(self, fixture: CoreFixture) -> None:
        events, battery = fixture.reader('alarms/events'), fixture.publisher('battery')
        assert events is not None and battery is not None
        self.events, self.battery = events, battery

    def step(self, now_ns: int) -> None:
        if now_ns % NS_PER_S == 0:
            self.battery.msg.percentage = 0.5 if now_ns < FULL_NS else 0.1
            self.battery.publish(now_ns)
        while self.events.take():
            event = json.loads(str(self.events.msg.data))
            if event['event'] == 'raised':
                self.raised[event['subject']] = event['alarm'], event['level'], event['kinds'][0]


def test_sink_wearables_notifier_and_battery_are_technical_alarms_of_their_own() -> None:
    settings, _ = load_from_arguments(['--ros-args', '--params-file', str(CONFIG)])
    silence = Silence()
    fixture = CoreFixture(settings, (JournalDevice(Random(1)), silence))
    try:
        fixture.core.prepare_modules()
        fixture.run(130 * NS_PER_S)
    finally:
        fixture.close()
    assert {subject: kind for subject, (_, _, kind) in silence.raised.items()} == {
        'sink': 'sink_silent', 'belt': 'sensor_off', 'oximeter': 'sensor_off',
        'wrist': 'sensor_off', 'bracelet': 'sensor_off', 'notifier': 'monitor_silent',
        'robot': 'robot_battery'}
    assert {level for _, level, _ in silence.raised.values()} == {'technical'}
    assert len({alarm for alarm, _, _ in silence.raised.values()}) == len(silence.raised)
