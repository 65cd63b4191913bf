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

"""A sink in a robot on the virtual clock: what is important passes a flood, commands arrive."""

from __future__ import annotations

from collections.abc import Callable
import random
from typing import Any

import pytest

from rt_robot_os.base.reports import Reports
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.devices.state import DeviceState
from rt_robot_os.devices.state import RecoverySettings
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.paper import DataMsg
from rt_robot_os.features.wsn.packets.paper import Kind
from rt_robot_os.features.wsn.packets.surge import SurgeCmd
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.features.wsn.sink.driver import Sink
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.testing import settings_of
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher
from serial_bench import MemoryPort
from serial_bench import MemorySerial

pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')

MS = 1_000_000
S = 1_000_000_000
PERIOD_NS = MS
TEXT = 'std_msgs/msg/String'
ALARM, VITAL, REST = 'alarm', 'vital', 'rest'
KINDS = {Kind.SMOKE: ALARM, Kind.PULSE: VITAL, Kind.TEMPERATURE: REST}


def reading(kind: Kind, number: int, origin: int = 5) -> bytes:
    body = DataMsg(0, 1, 3, number, kind, 3900).pack()
    header = MultihopMsg(0, origin, 0, number & 0x7FFF, 1, body)
    return frame(0x42, TelosMsg(0x7E, 17, header.pack()).pack())


class Robot:
    """
    A robot with a sink, which reads at 1 kHz, and a task for each class.

    :ivar handled: class and number of each packet, and when its task began with it.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, work_ns: dict[str, int],
                 **settings: Any) -> None:
        self.port: Any = MemoryPort('mote')
        self.port.plug()
        monkeypatch.setattr(Sink, 'make_port', type(
            'Line', (MemorySerial,), {'ports': {'mote': self.port}}))
        self.clock = VirtualClock(start_ns=S)
        self.kernel = Kernel(self.clock)
        self.bus = Bus(self.kernel)
        self.reports = Reports()
        self.handled: list[tuple[str, int, int]] = []
        self.device = Sink('sink', settings_of(Sink, port='mote', baud=0, **settings))
        self.device.log.connect(self.reports, self.kernel.now_ns)
        manager = SensorManager(self.kernel, self.bus, self.reports, recovery_priority=3)
        self.managed = manager.add(
            self.device, rate_hz=S / PERIOD_NS, priority=70,
            recovery=RecoverySettings(timeout_ns=S, retry_ns=S // 10, retry_maximum_ns=S))
        self.commands: Publisher | None = None
        if settings.get('command_topic'):
            self.bus.declare('wsn/command', TEXT, tail=64)
            self.commands = self.bus.publisher('wsn/command')
        manager.connect()
        for priority, name in ((60, ALARM), (50, VITAL), (20, REST)):
            self._add_reader(name, priority, work_ns.get(name, 0))
        self.run(0.1)

    def _add_reader(self, name: str, priority: int, work_ns: int) -> None:
        def step() -> None:
            while subscription.take():
                data = bytes(subscription.msg.data)
                self.handled.append(
                    (name, int.from_bytes(data[26:30], 'little'), self.kernel.now_ns()))
                self.clock.spend(work_ns)

        task = self.kernel.add_task(f'{name}s', step, priority=priority)
        subscription = self.bus.subscribe(f'wsn/packets/{name}', name, task=task)

    def run(self, seconds: float) -> None:
        self.kernel.run(round(seconds * S))

    def say(self, text: str) -> None:
        assert self.commands is not None
        self.commands.msg.data = text
        self.commands.publish()

    def numbers(self, name: str) -> list[int]:
        return [number for each, number, _ in self.handled if each == name]

    @property
    def more(self) -> dict[str, Any]:
        return self.managed.statistics().device.more

    def logged(self) -> str:
        return '\n'.join(str(line) for line in self.reports.since(0)[2]) + '\n'.join(
            text % arguments for line in list(self.reports.lines)
            for _, _, _, text, arguments in [line[0]])


Maker = Callable[..., Robot]


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch) -> Maker:
    def make(work_ns: dict[str, int] | None = None, **settings: Any) -> Robot:
        return Robot(monkeypatch, work_ns or {}, **settings)

    return make


# ---- importance ---------------------------------------------------------------------------------


def test_a_pulse_passes_the_temperatures_that_came_before_it(robot: Maker) -> None:
    made = robot({REST: 2 * MS}, depth=128)
    burst = [reading(Kind.TEMPERATURE, n) for n in range(100)]
    made.port.write(b''.join(burst) + reading(Kind.PULSE, 1) + reading(Kind.SMOKE, 2))
    made.run(0.5)
    assert [name for name, _, _ in made.handled[:3]] == [ALARM, VITAL, REST]
    assert made.numbers(REST) == list(range(100))
    assert made.more['lost_rest'] == 0


def test_what_waits_in_the_sink_is_passed_by_what_comes_later(robot: Maker) -> None:
    made = robot(queue=1000, packets_per_job=2)
    made.port.write(b''.join(reading(Kind.TEMPERATURE, n) for n in range(150)))
    made.run(0.005)
    assert 0 < made.more['waiting_rest'] < 150
    made.port.write(reading(Kind.SMOKE, 7))
    began_ns = made.kernel.now_ns()
    made.run(0.2)
    name, number, at_ns = next(each for each in made.handled if each[0] == ALARM)
    assert number == 7
    assert at_ns - began_ns <= 2 * PERIOD_NS
    behind = made.handled.index((name, number, at_ns))
    assert behind < 30, 'temperatures that waited went before the alarm'
    assert sorted(made.numbers(REST)) == list(range(150))


def test_a_flood_delays_no_alarm_and_displaces_nothing_but_its_own(robot: Maker) -> None:
    # The task of the rest takes 20 ms for a packet: it can do 50 of 160 a second.
    made = robot({REST: 20 * MS})
    chance = random.Random(1)
    sent: dict[str, list[int]] = {ALARM: [], VITAL: [], REST: []}
    began_ns: dict[tuple[str, int], int] = {}

    def line() -> None:
        kind = chance.choices((Kind.SMOKE, Kind.PULSE, Kind.TEMPERATURE), (1, 3, 96))[0]
        number = len(began_ns)
        if number >= 1600:
            return
        sent[KINDS[kind]].append(number)
        began_ns[KINDS[kind], number] = made.kernel.now_ns()
        made.port.write(reading(kind, number))

    made.kernel.add_task('line', line, priority=90, rate_hz=160.0)
    made.run(15)
    assert len(began_ns) == 1600
    assert made.numbers(ALARM) == sent[ALARM]
    assert made.numbers(VITAL) == sent[VITAL]
    assert max(at_ns - began_ns[name, number] for name, number, at_ns in made.handled
               if name != REST) <= PERIOD_NS
    rest = made.bus.topic('wsn/packets/rest')
    reader = next(each for each in rest.statistics().subscribers if each.name == REST)
    assert reader.lost > 0
    assert reader.reads + reader.lost + made.more['lost_rest'] == len(sent[REST])
    assert (made.more['lost_alarm'], made.more['lost_vital']) == (0, 0)


def test_a_queue_that_is_full_loses_its_oldest_and_counts_them(robot: Maker) -> None:
    made = robot(queue=50)
    made.port.write(b''.join(
        [reading(Kind.TEMPERATURE, n) for n in range(180)]
        + [reading(Kind.SMOKE, n) for n in range(3)]))
    made.run(1)
    assert made.numbers(REST) == list(range(130, 180))
    assert made.numbers(ALARM) == [0, 1, 2]
    statistics = made.managed.statistics()
    assert (made.more['lost_rest'], made.more['lost_alarm']) == (130, 0)
    assert statistics.device.lost_samples == 130
    assert '130 packets of class rest were lost because its queue was full' in statistics.reason


def test_classes_are_what_the_settings_say(robot: Maker) -> None:
    made = robot(classes=['alarm', 'vital', 'rest'], rules=[
        'alarm if origin 3-4 9 and type 17', 'vital if kind 1 and group 0x7d'])
    for n, origin in enumerate((3, 4, 5, 9)):
        made.port.write(reading(Kind.TEMPERATURE, n, origin))
    made.port.write(reading(Kind.PULSE, 7, 5))
    made.run(0.1)
    assert (made.numbers(ALARM), made.numbers(VITAL), made.numbers(REST)) == (
        [0, 1, 3], [2], [7])


# ---- commands -----------------------------------------------------------------------------------


def sent_to_mote(made: Robot) -> list[Any]:
    """Take the frames that the mote has got."""
    return FrameReader().feed(made.port.read())


def test_a_command_reaches_the_mote_and_is_acknowledged(robot: Maker) -> None:
    made = robot(command_topic='wsn/command')
    made.say('rate 5 2000')
    made.run(0.01)
    got, = sent_to_mote(made)
    assert got.protocol == 0x41
    packet = TelosMsg.unpack(got.packet)
    assert (packet.destination, packet.am_type, packet.group) == (5, 18, 0x7D)
    assert SurgeCmd.unpack(packet.payload) == (2, 2048)
    made.port.write(frame(0x40, bytes((got.token,))))
    made.run(2)
    assert sent_to_mote(made) == []
    assert (made.more['commands'], made.more['acknowledged_commands']) == (1, 1)
    assert made.managed.state is not DeviceState.FAULT


def test_a_command_that_is_not_acknowledged_is_tried_three_times_and_told(robot: Maker) -> None:
    made = robot(command_topic='wsn/command')
    made.say('sleep all')
    found = []
    for _ in range(20):
        made.run(0.05)
        found += [(made.kernel.now_ns(), each.token) for each in sent_to_mote(made)]
    assert len({token for _, token in found}) == 1
    times = [at_ns for at_ns, _ in found]
    assert [b - a for a, b in zip(times, times[1:])] == [250 * MS, 250 * MS]
    assert made.more['unacknowledged_commands'] == 1
    assert "command 'sleep all' was not acknowledged" in made.more['warning']
    assert "command 'sleep all': the mote has not acknowledged it in 3 tries" in made.logged()


def test_bad_commands_are_told_and_too_many_are_counted(robot: Maker) -> None:
    made = robot(command_topic='wsn/command')
    for text in ('dance 5', 'rate 5', 'rate 5 0', 'sleep 70000', ''):
        made.say(text)
        made.run(0.01)
    assert made.more['bad_commands'] == 5
    assert sent_to_mote(made) == []
    assert "'dance 5' is not a command" in made.logged()
    for node in range(15):
        made.say(f'wake {node}')
        made.run(0.005)
    assert made.more['lost_commands'] == 3
    assert 'is lost: 12 others wait' in made.logged()


def test_what_the_mote_wants_acknowledged_is(robot: Maker) -> None:
    made = robot()
    packet = FrameReader().feed(reading(Kind.PULSE, 1))[0].packet
    made.port.write(frame(0x41, b'\x26' + packet))
    made.run(0.01)
    assert made.port.read() == bytes.fromhex('7e402668497e')
    assert made.numbers(VITAL) == [1]


# ---- faults -------------------------------------------------------------------------------------


def test_a_quiet_network_is_no_fault(robot: Maker) -> None:
    made = robot(quiet_s=6.0)
    made.port.write(reading(Kind.PULSE, 1))
    made.run(5)
    assert made.managed.state is DeviceState.ACTIVE
    made.run(2)
    assert made.managed.faults == 1
    assert 'silent for 6 s: check that the mote is plugged in' in made.managed.reason


def test_garbage_is_told_soon_and_the_sink_comes_back(robot: Maker) -> None:
    made = robot()
    made.port.write(reading(Kind.PULSE, 1))
    made.run(0.5)
    chance = random.Random(3)
    for _ in range(15):
        made.port.write(chance.randbytes(200))
        made.run(0.1)
    assert made.managed.faults >= 1
    assert 'no valid frame for 1 s: check the baud rate (57600 under' in made.managed.reason
    for n in range(2, 20):
        made.port.write(reading(Kind.PULSE, n))
        made.run(0.1)
    assert made.managed.state is DeviceState.ACTIVE
    assert made.numbers(VITAL)[-1] == 19


def test_a_sink_that_is_unplugged_keeps_its_counters(robot: Maker) -> None:
    made = robot()
    for n in range(3):
        made.port.write(reading(Kind.PULSE, n) * 2)
        made.run(0.1)
    made.port.unplug()
    made.run(0.5)
    assert made.managed.state is DeviceState.FAULT
    made.port.plug()
    made.run(1)
    made.port.write(reading(Kind.PULSE, 2) + reading(Kind.PULSE, 3))
    made.run(0.1)
    assert made.managed.state is DeviceState.ACTIVE
    # What had come before the line broke is still known.
    assert made.numbers(VITAL) == [0, 1, 2, 3]
    assert made.more['duplicates'] == 4
