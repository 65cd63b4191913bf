#!/usr/bin/env python3
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
A scene for pictures and measurements of the page: a server, two scripted robots, a browser.

Three people with vital signs of the last hours, a sensor network, a robot that drives about the
map of the shipped flat, and an emergency. Used by ``page_pictures.py`` and ``measure_page.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextlib import ExitStack
import math
import os
from pathlib import Path
import shutil
import sys
from tempfile import TemporaryDirectory
import threading
import time
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / 'test' / 'shared')]

from fake_robot import FakeRobot  # noqa: E402
from fake_robot import RobotScript  # noqa: E402
from monitor_server import let_robot_in  # noqa: E402
from monitor_server import logged_in  # noqa: E402
from monitor_server import quick_services  # noqa: E402
from monitor_server import served  # noqa: E402
from rt_robot_os.messages.uplink.maps import MapMessage  # noqa: E402
from rt_robot_os.motion.grid_map import GridMap  # noqa: E402

NS_PER_S = 1_000_000_000
HISTORY_S = 3 * 3600
SIGNS = {'pulse_per_min': (72, 5), 'spo2_percent': (97, 0.8), 'respiration_per_min': (15, 1.2),
         'body_temperature': (36.7, 0.1)}
ILL = {'pulse_per_min': 38, 'spo2_percent': -4, 'respiration_per_min': 5, 'body_temperature': 0.9}
UNITS = {'pulse_per_min': '1/min', 'spo2_percent': '%', 'respiration_per_min': '1/min',
         'body_temperature': 'degC', 'systolic_mmhg': 'mmHg'}
NODES = ((0, 'sink', 'sink', 0.6, 0.6, -1, 0, 5.0, None, 1.0, 0.0, 0),
         (1, 'living', 'good', 2.9, 1.2, 0, 1, 2.91, 240, 0.998, 3.0, 0),
         (2, 'kitchen', 'good', 7.7, 2.3, 0, 1, 2.84, 188, 0.991, 2.0, 12),
         (3, 'washer', 'weak', 8.6, 0.9, 2, 2, 2.31, 9, 0.712, 5.0, 331),
         (4, 'bedroom', 'good', 3.2, 6.0, 1, 2, 2.95, 301, 0.995, 4.0, 5),
         (5, 'study', 'silent', 7.2, 6.2, 4, 3, 2.62, 80, 0.931, 214.0, 96),
         (6, 'wrist', 'good', 2.45, 3.95, 1, 2, 3.71, 12, 0.974, 1.0, 41))


def value_of(person: str, sign: str, t_s: float) -> float:
    """Return a value that varies as vital signs do; anna becomes ill in the last half hour."""
    mean, spread = SIGNS[sign]
    phase = sum(map(ord, person + sign))
    slow = math.sin(t_s / 700 + phase) + 0.5 * math.sin(t_s / 173 + 2 * phase)
    quick = 0.4 * math.sin(t_s * 1.7 + phase) + 0.3 * math.sin(t_s * 0.31 + phase)
    ill = max(0.0, 1 - (time.time() - t_s) / 1800) if person == 'anna' else 0.0
    return mean + spread * (slow + quick) + ill * ILL[sign]


def signs_of(person: str, t_s: float) -> dict[str, Any]:
    """Return the signs of a person as the robot publishes them."""
    found = {sign: value_of(person, sign, t_s) for sign in SIGNS}
    rows = [(sign, f'{value:.1f}', 'off' if person == 'clara' and sign == 'spo2_percent' else
             'good', '0.8') for sign, value in found.items()]
    rows.append(('systolic_mmhg', '128', 'good', '1260') if person == 'bob' else
                ('systolic_mmhg', '', 'missing', ''))
    return {'status': [{
        'level': 0, 'name': f'{person}/{sign}', 'message': value, 'hardware_id': 'wrist',
        'values': {'value': value, 'unit': UNITS[sign], 'quality': quality, 'age_s': age,
                   'source': 'wrist', 'stamp_ns': ''}} for sign, value, quality, age in rows]}


def news2_of(person: str) -> dict[str, Any]:
    """Return the score of a person as the robot publishes it."""
    total, risk, missing = {'anna': ('', 'Medium', 'systolic_mmhg consciousness'),
                            'bob': ('1', 'Low', ''),
                            'clara': ('', 'Low', 'spo2_percent systolic_mmhg')}[person]
    return {'status': [{'level': 0, 'name': f'{person}/news2', 'message': '', 'hardware_id': '',
                        'values': {'total': total, 'complete': str(not missing).lower(),
                                   'missing': missing, 'risk': risk,
                                   'at_least': '5' if person == 'anna' else '1'}}]}


def place_of(room: str, x: float, y: float) -> dict[str, Any]:
    """Return where a person is as the robot publishes it."""
    values = {'room': room, 'how': 'seen', 'x': f'{x:.2f}', 'y': f'{y:.2f}', 'age_s': '1'}
    return {'status': [{'level': 0, 'name': 'place', 'message': room, 'hardware_id': '',
                        'values': values}]}


def nodes() -> dict[str, Any]:
    """Return the rows of the sensor network."""
    keys = ('id', 'name', 'state', 'x', 'y', 'parent', 'hops', 'battery_v', 'days_left', 'recent',
            'age_s', 'lost')
    return {'nodes': [{**dict(zip(keys, row)), 'delivery': row[9], 'received': 3200 + 417 * row[0]}
                      for row in NODES]}


class Scene:
    """
    What happens.

    :ivar url: of the page.
    :ivar cookie: of somebody who may do everything.
    """

    def __init__(self, address: str, services: Any) -> None:
        self.url = f'http://{address}'
        self.cookie = logged_in(services, 'mary')['Cookie'].partition('=')[2]
        self.flat, self.house = (FakeRobot(f'ws://{address}', script=each) for each in (
            RobotScript('flat', ('anna', 'bob'), limits={'linear_m_s': 0.5, 'angular_rad_s': 1.2}),
            RobotScript('house', ('clara',), limits={'linear_m_s': 0.5, 'angular_rad_s': 1.2})))
        self._ended = threading.Event()

    def begin(self) -> None:
        """Send the past, then what is live, until :meth:`end`."""
        now_s = time.time()
        for robot, people in ((self.flat, ('anna', 'bob')), (self.house, ('clara',))):
            for person in people:
                robot.keep(*({**robot.script.record('observation', {
                    'person': person, 'sign': sign, 'value': value_of(person, sign, now_s - age_s),
                    'quality': 'good', 'source': 'wrist'}), 'utc_ns': int(
                        (now_s - age_s) * NS_PER_S)}
                    for age_s in range(HISTORY_S, 0, -20) for sign in SIGNS))
        self.tell()
        threading.Thread(target=self._live, daemon=True).start()

    def end(self) -> None:
        """End it."""
        self._ended.set()

    def tell(self) -> None:
        """Say how everything is now."""
        t_s = time.time()
        x, y = 3.0 + 1.2 * math.sin(t_s / 9), 2.6 + 0.9 * math.cos(t_s / 7)
        yaw = math.atan2(-0.9 / 7 * math.sin(t_s / 7), 1.2 / 9 * math.cos(t_s / 9))
        self.flat.live(**{
            'battery': {'percentage': 0.78, 'voltage': 25.1}, 'stop_reason': '',
            'agent/state': 'approach anna: fall', 'pose': {'x': x, 'y': y, 'yaw': yaw},
            'plan': {'points': [[x, y], [2.6, 3.2], [2.45, 3.6]]}, 'wsn/nodes': nodes(),
            'speed': {'linear_m_s': 0.21, 'angular_rad_s': 0.1},
            'health/anna/place': {'x': 2.45, 'y': 3.95, 'yaw': 0},
            'health/anna/place_details': place_of('living', 2.45, 3.95),
            'health/bob/place': {'x': 7.4, 'y': 1.9, 'yaw': 0},
            'health/bob/place_details': place_of('kitchen', 7.4, 1.9),
            **_health('anna', t_s), **_health('bob', t_s)})
        self.house.live(**{'battery': {'percentage': 0.16, 'voltage': 22.3}, 'stop_reason': '',
                           'agent/state': 'idle', **_health('clara', t_s)})

    def fall(self) -> None:
        """Have anna fall, and the washer be heard badly."""
        self.house.raise_alarm('3', subject='study', level='technical', kinds=['node_silent'],
                               text='study has said nothing for 3 min', state='acknowledged',
                               event='acknowledged', by='mary')
        more = {'node': 'wrist', 'x': 2.45, 'y': 3.95, 'text': 'anna lies in the living room'}
        for event, state, by, why in (
                ('suspected', 'suspected', '', ''), ('confirmed', 'suspected', 'agent',
                                                     'no answer for 25 s'),
                ('raised', 'raised', 'agent', 'no answer for 25 s'),
                ('notified', 'raised', '', 'operator'), ('delivered', 'raised', '', 'operator'),
                ('escalated', 'raised', '', 'family'),
                ('failed', 'raised', '', 'family: mail server does not answer')):
            self.flat.raise_alarm('7', event=event, state=state, by=by, why=why, **more)

    def _live(self) -> None:
        while not self._ended.wait(0.05):
            self.tell()


def _health(person: str, t_s: float) -> dict[str, Any]:
    return {f'health/{person}/signs': signs_of(person, t_s),
            f'health/{person}/news2_details': news2_of(person),
            **{f'health/{person}/{sign}': value_of(person, sign, t_s) for sign in SIGNS}}


@contextmanager
def scene() -> Iterator[Scene]:
    """Begin a scene, and end it."""
    with TemporaryDirectory() as folder, ExitStack() as stack:
        services = quick_services(Path(folder))
        let_robot_in(services, 'flat')
        let_robot_in(services, 'house')
        grid = GridMap.load(ROOT / 'config' / 'maps' / 'flat.yaml')
        height, width = grid.cells.shape
        services.maps.put('flat', MapMessage.pack(
            width, height, grid.resolution_m, grid.origin, grid.cells.tobytes()))
        found = Scene(stack.enter_context(served(services)), services)
        stack.enter_context(found.flat)
        stack.enter_context(found.house)
        found.begin()
        stack.callback(found.end)
        yield found


def browser_path() -> str:
    """Return where a Chromium is; ends the program when there is none."""
    names = ('chromium', 'chromium-browser', 'google-chrome')
    found = os.environ.get('RT_ROBOT_OS_BROWSER') or next(filter(None, map(shutil.which, names)),
                                                          None)
    if found is None:
        sys.exit('no browser: install chromium, or say where it is in RT_ROBOT_OS_BROWSER')
    return found
