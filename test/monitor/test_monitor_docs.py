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

"""The page that users start with says what there is."""

from __future__ import annotations

from pathlib import Path
import re
import shlex
from urllib.parse import parse_qs

from monitor_server import quick_services
import pytest
from rt_robot_os.base.schema import declared
from rt_robot_os.gateway.command import run as run_gateway
from rt_robot_os.messages.uplink import greeting
from rt_robot_os.messages.uplink.frames import FRAME_BYTES
from rt_robot_os.messages.uplink.messages import MESSAGE_BYTES
from rt_robot_os.monitor import connections
from rt_robot_os.monitor.api.commands import NEEDS
from rt_robot_os.monitor.app import create_app
from rt_robot_os.monitor.command import run as run_monitor
from rt_robot_os.monitor.live import client_connection
from rt_robot_os.monitor.live import robot_connection
from rt_robot_os.monitor.live import robot_state
from rt_robot_os.monitor.live import send_queue
from rt_robot_os.monitor.security import audit
from rt_robot_os.monitor.security import outage
from rt_robot_os.monitor.security import protection
from rt_robot_os.monitor.settings import MonitorSettings
from rt_robot_os.monitor.store import adding

#: The beginnings of rows of the table of limits, and what their second cells say.
LIMITS = {
    'a request': (f'{connections.PATIENCE_S:g} s', f'{protection.BODY_BYTES >> 20} MiB'),
    'requests open': ('`connections`',),
    'TLS handshakes': (f'{connections.HANDSHAKES}, {connections.HANDSHAKE_S:g} s each',),
    'requests of an address': (f'{protection.PER_S:g} a second', f'{protection.BURST} at once'),
    'messages of a browser': (f'{client_connection.MESSAGES_A_SECOND} a second',
                              f'({2 * client_connection.MESSAGES_A_SECOND} at once)',
                              f'{client_connection.MESSAGE_CHARACTERS >> 10} KB'),
    'watches of a browser': (f'{client_connection.WATCHES_MOST}',
                             f'{client_connection.PATTERNS_MOST}'),
    'a message of a robot': (f'{MESSAGE_BYTES >> 20} MiB', f'pictures {FRAME_BYTES >> 20} MiB'),
    'batches of a robot': (f'{robot_connection.BATCHES_MOST}',),
    'signals, people, open alarms': (
        f'{robot_state.SIGNALS_MOST}, {greeting.PEOPLE_MOST}, {robot_state.ALARMS_MOST}',),
    'hello of a robot': (f'{robot_connection.HELLO_S:g} s',),
    'records of a start': (f'{adding.ASIDE_MOST:,} are set aside',),
    'an answer of the database': (f'{outage.PATIENCE_S:g} s',),
    'rows of the audit': (f'{audit._WAITING:,}',)}
#: What promises say in figures.
PROMISES = (f'{connections.UNSENT_BYTES >> 10} KB in the system',
            f'up to {send_queue.URGENT_MOST} urgent messages',
            f'after {connections.STALLED_S:g} s',
            f'for {outage.OUTAGE_S / 3600:g} hours')

TEXT = (Path(__file__).resolve().parents[2] / 'docs' / 'monitor.md').read_text()


def test_every_setting_is_explained_with_its_default() -> None:
    table = TEXT.partition('## Settings')[2].partition('\n## ')[0]
    rows = {name: row for row in table.splitlines() if row.startswith('| `')
            for name in re.findall(r'`(\w+)`', row.split('|')[1])}
    assert set(rows) == {each.name for each in declared(MonitorSettings)}
    for each in declared(MonitorSettings):
        if isinstance(each.default, int | float):
            assert f'{each.default:g}' in rows[each.name].split('|')[2], each.name


def test_every_command_is_explained_with_what_it_needs() -> None:
    table = TEXT.partition('| `do` |')[2].partition('\n\n')[0]
    rows = {name: row.split('|')[3] for row in table.splitlines() if row.startswith('| `')
            for name in re.findall(r'`(\w+)`', row.split('|')[1])}
    assert set(rows) == set(NEEDS)
    for name, needed in NEEDS.items():
        assert all(each.value in rows[name] for each in needed), name


def test_the_first_settings_are_options_as_well(capsys: pytest.CaptureFixture[str]) -> None:
    names = re.findall(r'`(\w+)`', ''.join(
        row.split('|')[1] for row in TEXT.partition('## Settings')[2].splitlines()
        if row.startswith('| `')))
    shown = help_of(run_monitor, [], capsys)
    assert [f'--{name}' in shown for name in names] == [number < 6 for number in range(len(names))]


def help_of(run: object, words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit):
        run([*words, '--help'])  # type: ignore[operator]
    return capsys.readouterr().out


def test_every_option_that_is_typed_exists(capsys: pytest.CaptureFixture[str]) -> None:
    lines = re.findall(r'^(?:\$ )?((?:monitor|gateway) .*)$', '\n'.join(
        [*re.findall(r'```console\n(.*?)```', TEXT, re.DOTALL),
         *re.findall(r'`([^`\n]+)`', TEXT)]),
        re.MULTILINE)
    assert len(lines) > 5
    for line in lines:
        program, *words = shlex.split(line, comments=True)
        commands = [each for each in words[:2] if re.fullmatch('[a-z]+', each)]
        if program == 'monitor' and commands[:1] == ['certificate']:
            commands = commands[:1]
        shown = help_of(run_monitor if program == 'monitor' else run_gateway, commands, capsys)
        for option in (each for each in words if each.startswith('--')):
            assert option in shown, line


def test_every_limit_is_the_one_of_the_code() -> None:
    table = TEXT.partition('## Limits')[2].partition('\n## ')[0]
    rows = {row.split('|')[1].strip(): row.split('|')[2] for row in table.splitlines()
            if row.startswith('| ')}
    for begin, said in LIMITS.items():
        cell, = (cell for name, cell in rows.items() if name.startswith(begin))
        numbers = re.findall(r'\d+(?:,\d{3})*', cell)
        for each in said:
            assert each in cell if ' ' in each or '`' in each else each in numbers, (begin, cell)


def test_every_figure_of_the_promises_is_the_one_of_the_code() -> None:
    promises = TEXT.partition('## What is promised')[2].partition('\n## ')[0]
    assert [each for each in PROMISES if each not in promises] == []


def test_every_endpoint_that_is_listed_exists_and_takes_what_is_said(tmp_path: Path) -> None:
    services = quick_services(tmp_path)
    paths = create_app(services).openapi()['paths']
    table = TEXT.partition('| endpoint |')[2].partition('\n\n')[0]
    listed = 0
    for row in table.splitlines():
        base = ''
        for found in re.findall(r'`([^`]+)`', row.split('|')[1] if row.startswith('|') else ''):
            method, path = found.split(' ') if ' ' in found else ('GET', found)
            path, _, query = path.partition('?')
            path = base + path.removeprefix('...') if path.startswith('...') else path
            base = base or path
            assert method.lower() in paths.get(path, {}), f'{method} {path}'
            known = {each['name'] for each in paths[path][method.lower()].get('parameters', ())}
            assert set(parse_qs(query, keep_blank_values=True)) <= known, found
            listed += 1
    assert listed > 10
