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


"""What a module tells of itself, from its statistics() to /diagnostics."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from rt_robot_os.core.statistics import statistics_of
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.link.core_statistics import CoreStatistics
from rt_robot_os.link.stamp_mapper import StampMapper
from rt_robot_os.modules import Module


class Telling(Module):
    """Say something of every kind."""

    def statistics(self) -> Mapping[str, Any]:
        return {'samples': 7, 'gain': 0.5, 'at_rest': True, 'filter': 'mahony', 'odd': [1, 2],
                9: None}  # type: ignore[dict-item]


class Failing(Module):
    """Cannot say anything."""

    def statistics(self) -> Mapping[str, Any]:
        raise ZeroDivisionError('no samples')


def test_a_module_that_says_nothing_says_nothing() -> None:
    assert statistics_of(Module('silent', {})) == {}


def test_whatever_a_module_says_can_be_sent() -> None:
    assert statistics_of(Telling('telling', {})) == {
        'samples': 7, 'gain': 0.5, 'at_rest': True, 'filter': 'mahony', 'odd': '[1, 2]',
        '9': 'None'}


def test_a_module_that_fails_to_say_it_is_told_of() -> None:
    assert statistics_of(Failing('failing', {})) == {
        'warning': 'statistics() failed: ZeroDivisionError: no samples'}


def said_by(tmp_path: Path) -> list[dict[str, Any]]:
    """Give what a core with an attitude module answers to a request for statistics."""
    pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')
    from rt_robot_os.core.app import Core
    from rt_robot_os.link.protocol import decode_json
    from rt_robot_os.link.protocol import encode_json
    from rt_robot_os.link.protocol import PacketKind
    from rt_robot_os.settings import load
    tmp_path.joinpath('robot.yaml').write_text("""
robot:
  ros__parameters:
    modules: [attitude]
    attitude: {type: attitude, rate_hz: 400.0, filter: mahony, axes: 6}
    topics: [imu]
    imu: {topic: imu/data, message: sensor_msgs/msg/Imu, fixed: {header.frame_id: imu_link}}
""")
    core = Core(load([tmp_path / 'robot.yaml']), tmp_path / 'socket',
                clock=VirtualClock(start_ns=1))
    core.modules[0].configure()
    sent: list[bytes] = []

    class Client:
        post_all = staticmethod(sent.extend)

    core.requests.answer(
        Client(),  # type: ignore[arg-type]
        encode_json(PacketKind.REQUEST, {'id': 5, 'do': 'statistics'}))
    return [decode_json(packet) for packet in sent if b'"part":' in packet]


def test_a_core_sends_the_statistics_of_its_modules(tmp_path: Path) -> None:
    parts = [part for part in said_by(tmp_path) if part['part'] == 'module']
    assert [(part['name'], part['values']['filter']) for part in parts] == [
        ('attitude', 'mahony')]


def test_diagnostics_show_a_module_and_its_warning(tmp_path: Path) -> None:
    pytest.importorskip('diagnostic_msgs', reason='ROS 2 messages are not installed')
    from rt_robot_os.ros.diagnostics import Diagnostics
    from rt_robot_os.ros.diagnostics import OK
    from rt_robot_os.ros.diagnostics import WARN
    modules = ({'name': 'a', 'values': {'samples': 7, 'warning': ''}},
               {'name': 'b', 'values': {'warning': 'no field'}}, {'name': 'c', 'values': {}})
    core, = (part for part in said_by(tmp_path) if part['part'] == 'core')
    found = Diagnostics('robot').judge(
        CoreStatistics(core, (), (), (), (), modules=modules), StampMapper(), ())
    told = {status.name: (status.level, status.message,
                          [(v.key, v.value) for v in status.values]) for status in found}
    assert told['robot: module a'] == (OK, 'at work', [('samples', '7')])
    assert told['robot: module b'] == (WARN, 'no field', [])
    assert 'robot: module c' not in told


def test_diagnostics_warn_of_an_active_device_that_says_why(tmp_path: Path) -> None:
    pytest.importorskip('diagnostic_msgs', reason='ROS 2 messages are not installed')
    from rt_robot_os.ros.diagnostics import Diagnostics
    from rt_robot_os.ros.diagnostics import OK
    from rt_robot_os.ros.diagnostics import WARN

    def device(name: str, reason: str) -> dict[str, object]:
        return {'name': name, 'state': 'active', 'reason': reason, 'faults': 0, 'opened': 1,
                'age_ns': 0, 'device': {}}

    core, = (part for part in said_by(tmp_path) if part['part'] == 'core')
    found = Diagnostics('robot').judge(
        CoreStatistics(core, (), (), devices=(device('a', ''), device('b', '9 valid frames, but '
                                                                      'no sample')), clients=()),
        StampMapper(), ())
    told = {status.name: (status.level, status.message) for status in found}
    assert told['robot: device a'] == (OK, 'active')
    assert told['robot: device b'] == (WARN, 'active: 9 valid frames, but no sample')
