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

"""Parts of the core that come from elsewhere, and the table of requests that they add to."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from pathlib import Path
import tempfile
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import LinkError
from rt_robot_os.core.app import Core
from rt_robot_os.core.part import CorePart
from rt_robot_os.core.part import Host
from rt_robot_os.core.part import installed_parts
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.link.protocol import decode_json
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.requests import Requests
from rt_robot_os.settings import load

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

S = 1_000_000_000
YAML = """\
robot:
  ros__parameters:
    modules: [guard]
    guard: {type: twist_guard, rate_hz: 100.0}
    topics: [cmd_vel]
    cmd_vel: {message: geometry_msgs/msg/Twist}
"""


class Odometer(CorePart):
    """A task, a topic that it reads, requests, a counter, and an end."""

    def __init__(self, host: Host) -> None:
        self.updates = self.looks = self.taken = 0
        self.opened = self.closed = False
        self.commands = host.bus.subscribe('cmd_vel_safe', 'odometer')
        host.kernel.add_task('odometer', self.update, priority=5, rate_hz=10.0)
        host.watch.add(self.look)
        host.statistics.add_facts(lambda: {'odometer_updates': self.updates})
        host.statistics.add_facts(lambda: {'odometer_share': self.updates / 0})
        host.requests.add('odometer', lambda session, arguments: {
            'updates': self.updates, 'by': session.name})
        host.requests.add_long('odometers', lambda session, arguments: (
            {'number': number} for number in range(int(arguments['count']))))
        host.requests.add_long('odometer_fails', lambda session, arguments: self.fail())

    def update(self) -> None:
        self.updates += 1
        while self.commands.take():
            self.taken += 1

    def look(self) -> None:
        self.looks += 1

    def fail(self) -> Iterator[dict[str, Any]]:
        yield {'number': 0}
        raise ZeroDivisionError('half way')

    def open(self) -> None:  # noqa: A003
        self.opened = True

    def close(self) -> None:
        self.closed = True


class Unmade(CorePart):
    """Cannot be made."""

    def __init__(self, host: Host) -> None:
        raise ZeroDivisionError('no wheels')


class Rival(CorePart):
    """Wants to answer what is answered already."""

    def __init__(self, host: Host) -> None:
        host.requests.add('rearm', lambda session, arguments: {})


class Unopened(CorePart):
    """Cannot be opened."""

    def open(self) -> None:  # noqa: A003
        raise OSError('no such map')


class Client:
    """A session that keeps what it is sent."""

    name = 'tester'

    def __init__(self, requests: Requests) -> None:
        self.requests = requests
        self.gone = ''
        self.sent: list[bytes] = []
        self.post = self.sent.append
        self.post_all = self.sent.extend

    def ask(self, do: str, **arguments: Any) -> list[dict[str, Any]]:
        self.sent.clear()
        self.requests.answer(self, encode_json(  # type: ignore[arg-type]
            PacketKind.REQUEST, {'id': 1, 'do': do, **arguments}))
        return [decode_json(packet) for packet in self.sent if packet[0] == PacketKind.REPLY]


Make = Callable[..., Core]


@pytest.fixture
def make() -> Iterator[Make]:
    made: list[Core] = []
    with tempfile.TemporaryDirectory(prefix='rtx') as folder:
        path = Path(folder) / 'robot.yaml'
        path.write_text(YAML)

        def core(*parts: type[CorePart]) -> Core:
            made.append(Core(load([path]), Path(folder) / 'robot.sock',
                             clock=VirtualClock(start_ns=S), parts=parts))
            return made[-1]

        yield core
        for each in made:
            each.close()


@pytest.fixture
def core(make: Make) -> Core:
    return make(Odometer)


def part_of(core: Core) -> Odometer:
    part, = core.parts.all
    assert isinstance(part, Odometer)
    return part


def test_a_part_from_elsewhere_has_a_task_a_request_and_a_counter(core: Core) -> None:
    client, part = Client(core.requests), part_of(core)
    core.prepare_modules()
    core.kernel.run(S)
    assert part.opened
    assert client.ask('odometer') == [{'updates': part.updates, 'by': 'tester'}]
    assert part.updates == part.looks == 10 and part.taken > 50
    assert client.ask('statistics')[-2]['odometer_updates'] == 10
    core.close()
    assert part.closed


def test_a_part_that_fails_is_named_and_the_core_does_not_run_without_it(make: Make) -> None:
    with pytest.raises(ConfigError, match='part of the core Unmade could not be created: '
                                          'ZeroDivisionError: no wheels'):
        make(Odometer, Unmade)
    with pytest.raises(ConfigError, match='part of the core Rival could not be created: request '
                                          "'rearm' exists already"):
        make(Rival)
    core = make(Odometer, Unopened)
    part = core.parts.all[0]
    with pytest.raises(ConfigError, match='part of the core Unopened could not be opened: OSErr'):
        core.run(S)
    assert isinstance(part, Odometer) and part.opened and part.closed and not part.updates


def test_statistics_that_fail_hide_no_others_and_are_told_once(core: Core) -> None:
    client = Client(core.requests)
    for _ in range(2):
        assert client.ask('statistics')[-2]['odometer_updates'] == 0
    told = [report.text for report in core.reports.since(0)[2]]
    assert [text for text in told if 'statistics are incomplete' in text] == [
        'statistics are incomplete: ZeroDivisionError: division by zero']


def test_an_answer_of_many_packets_ends_with_an_empty_one_or_a_reason(core: Core) -> None:
    client = Client(core.requests)
    assert client.ask('odometers', count=2) == [{'number': 0}, {'number': 1}, {}]
    assert client.ask('odometer_fails') == [
        {'number': 0}, {'error': 'the answer ends early: ZeroDivisionError: half way'}]


def test_a_request_belongs_to_one(core: Core) -> None:
    for do in ('statistics', 'rearm'):
        with pytest.raises(LinkError, match=f"request '{do}' exists already"):
            core.requests.add(do, lambda session, arguments: {})


def test_installed_parts_are_found_by_their_entry_points(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def install(name: str, target: str) -> None:
        facts = tmp_path / name / f'{name}-1.0.dist-info'
        facts.mkdir(parents=True)
        facts.joinpath('METADATA').write_text(
            f'Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n')
        facts.joinpath('entry_points.txt').write_text(
            f'[rt_robot_os.core_parts]\n{name} = {target}\n')
        monkeypatch.syspath_prepend(str(tmp_path / name))

    install('odometer', f'{__name__}:Odometer')
    assert 'Odometer' in [part.__name__ for part in installed_parts()]
    install('broken', 'no_such_package:Part')
    with pytest.raises(ConfigError, match=r"part of the core 'broken' \(no_such_package:Part\)"):
        installed_parts()
