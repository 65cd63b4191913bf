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

"""Each serial device with each fault: the diagnosis says which and what to do, others run on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field
from datetime import datetime
from datetime import timezone
import re
from typing import Any

import pytest

from rt_robot_os.devices.nmea.wire import gga
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.state import DeviceState
from serial_bench import SerialBench

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')


@dataclass(frozen=True)
class Case:
    """
    A device under test.

    :ivar topic_hz: samples a second on its main topic.
    :ivar wrong: what the diagnosis says when another device is in its place.
    :ivar silent: what it says when nothing comes.
    :ivar baud: what it says when the speed is wrong.
    :ivar recovery_s: how long it takes until it works again, its set-up included.
    """

    topic_hz: float
    settings: dict[str, Any] = field(default_factory=dict)
    sim: dict[str, Any] = field(default_factory=dict)
    topic: str = 'imu/data'
    wrong: str = 'these are NMEA 0183 sentences at .* baud: set type: nmea, or swap the ports'
    silent: str = 'silent for 1 s: check its power, its wiring'
    baud: str = 'no valid frame for 1 s: check the baud rate'
    recovery_s: float = 1.1


CASES = {
    'arduino_bridge': Case(30, topic='joint_states', silent='silent for 1 s: check its cable, '
                           'that the firmware ros_arduino_bridge is on it'),
    'bno055': Case(100),
    'bno055 that overruns': Case(50, {'output_rate_hz': 50.0}, {'overrun_every': 7}),
    'witmotion': Case(100),
    'nmea': Case(5, {'baud': 38400}, {'rate_hz': 5.0}, 'gps/fix',
                 'these are WitMotion frames at .* baud: set type: witmotion'),
    'hokuyo': Case(10, topic='scan', silent='silent for 1 s: check its power .it needs up to'),
    'hokuyo that scans': Case(10, {'configure': False}, {'scanning': True}, 'scan',
                              silent='silent for 1 s: check its power .it needs up to'),
    'kobuki': Case(50, topic='joint_states', silent='silent for 1 s: check that it is switched '
                   'on, and its USB cable'),
    'maxbotix': Case(10, sim={'corrupt_probability': 0.1}, topic='range'),
    'odrive': Case(50, topic='joint_states', silent='silent for 1 s: check its power, its cable, '
                   'and that the ASCII protocol is on'),
    'oximeter': Case(3, topic='oximeter/status',
                     silent='silent for 1 s: check that it is switched on'),
    'roboclaw': Case(30, topic='joint_states', silent='silent for 1 s: check its power and its '
                     'wiring, that it is in packet serial mode'),
    'sharp': Case(25, topic='range', wrong='these are WitMotion frames'),
    'stargazer': Case(20, topic='stargazer/pose'),
    'stargazer configured': Case(20, {'configure': True}, topic='stargazer/pose',
                                 recovery_s=5.0),
    'ublox': Case(5, {'output_rate_hz': 5.0}, {'rate_hz': 5.0}, 'gps/fix',
                  'these are WitMotion frames at .* baud: set type: witmotion'),
    'ublox configured': Case(
        10, {'configure': True, 'output_rate_hz': 10.0, 'baud': 115200}, {'mixed': True},
        'gps/fix', 'these are WitMotion frames at .* baud: set type: witmotion'),
    'xsens': Case(100),
    'xsens configured': Case(50, {'configure': True, 'output_rate_hz': 50.0}),
}


def test_every_serial_driver_is_here() -> None:
    serial = {name for name in DRIVERS.names() if issubclass(DRIVERS.load(name), SerialDevice)}
    # A sink is quiet when its nodes are: test_sink_network.py.
    assert {name.split()[0] for name in CASES} >= serial - {'sink'}


@pytest.fixture(params=CASES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def case(name: str) -> Case:
    return CASES[name]


@pytest.fixture
def bench(name: str, case: Case, monkeypatch: pytest.MonkeyPatch) -> Iterator[SerialBench]:
    """Give the device ``dut`` and another one beside it, which is to run on."""
    made = SerialBench(monkeypatch)
    made.add('dut', name.split()[0], case.settings, case.sim)
    made.add('other', 'witmotion', {}, {})
    yield made
    made.take('other/imu/data')
    made.run(0.5)
    other = made.devices['other']
    assert (other.state, other.faults) == (DeviceState.ACTIVE, 0)
    assert made.kernel.task('other').missed == 0
    assert not made.kernel.failures
    assert made.take('other/imu/data') == 50


def settle(bench: SerialBench) -> None:
    """Run until all is well, and forget the samples so far."""
    bench.run(2)
    dut = bench.devices['dut']
    assert (dut.state, dut.faults) == (DeviceState.ACTIVE, 0), bench.errors('dut')
    for topic in bench.readers:
        bench.take(topic)


def inject(bench: SerialBench, fault: str, seconds: float = 2.5) -> str:
    """Have a fault, and give the one thing that was said about it."""
    settle(bench)
    bench.simulated['dut'].inject(fault, seconds)
    bench.run(seconds - 0.1)
    dut = bench.devices['dut']
    assert dut.faults >= 1
    texts = bench.errors('dut')
    assert len(texts) >= 1
    return texts[0]


def recovers(bench: SerialBench, case: Case) -> None:
    bench.run(case.recovery_s)
    for topic in bench.readers:
        bench.take(topic)
    bench.run(1)
    assert bench.devices['dut'].state is DeviceState.ACTIVE
    assert bench.take(f'dut/{case.topic}') == pytest.approx(case.topic_hz, abs=2)


def test_without_a_fault_nothing_is_rejected_or_lost(bench: SerialBench, case: Case) -> None:
    settle(bench)
    bench.run(1)
    assert bench.take(f'dut/{case.topic}') == pytest.approx(case.topic_hz, abs=1)
    counters = bench.devices['dut'].statistics().device
    assert (counters.rejected_bytes, counters.rejected_frames, counters.lost_samples,
            counters.contradicted_samples, counters.dropped_write_bytes) == (0, 0, 0, 0, 0)
    assert not bench.errors('dut')


def test_silence(bench: SerialBench, case: Case) -> None:
    assert_says(inject(bench, 'silent'), case.silent)
    recovers(bench, case)


def test_wrong_baud_rate(bench: SerialBench, case: Case) -> None:
    assert_says(inject(bench, 'baud'), case.baud)
    recovers(bench, case)


def test_another_device_in_its_place(bench: SerialBench, case: Case) -> None:
    assert_says(inject(bench, 'wrong'), case.wrong)
    recovers(bench, case)


def test_unplugged_and_plugged_in_again(bench: SerialBench, case: Case) -> None:
    assert_says(inject(bench, 'unplug'), 'port dut is gone: check the cable')
    recovers(bench, case)


def test_noise_on_the_line_costs_samples_and_nothing_else(bench: SerialBench, case: Case) -> None:
    settle(bench)
    bench.simulated['dut'].inject('corrupt', 2.0)
    bench.run(2)
    counters = bench.devices['dut'].statistics().device
    assert counters.rejected_bytes > 0
    recovers(bench, case)


def test_fragments_make_no_difference(bench: SerialBench, case: Case) -> None:
    settle(bench)
    bench.simulated['dut'].inject('short', 1.0)
    bench.run(1)
    assert bench.take(f'dut/{case.topic}') == pytest.approx(case.topic_hz, abs=1)
    assert bench.devices['dut'].statistics().device.rejected_bytes == 0


def assert_says(text: str, wanted: str) -> None:
    assert re.search(wanted, text), text


def test_a_wrong_chip_is_told_and_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = SerialBench(monkeypatch)
    dut = bench.add('dut', 'bno055', {}, {'chip_id': 0x55})
    bench.add('other', 'witmotion', {}, {})
    bench.run(3)
    assert dut.state is not DeviceState.ACTIVE
    assert dut.faults > 3
    assert bench.errors('dut') == [
        'chip id 0x55 is not that of a BNO055 (0xa0): check what is connected']
    assert bench.devices['other'].state is DeviceState.ACTIVE


def test_a_product_that_has_less_is_told_what_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = SerialBench(monkeypatch)
    fast = {'configure': True, 'output_rate_hz': 200.0, 'baud': 460800}
    bench.add('slow', 'xsens', fast, {'product': 'MTi-3'})
    bench.add('plain', 'xsens', fast, {'product': 'MTi-100'})
    bench.add('full', 'xsens', fast, {})
    bench.run(3)
    assert bench.errors('slow') == [
        'of orientation at 200 Hz it sends 100 Hz: set output_rate_hz: 100']
    assert bench.errors('plain') == [
        'this product has no orientation: set orientation: false']
    assert bench.errors('full') == []
    bench.take('full/imu/data')
    bench.run(1)
    assert bench.take('full/imu/data') == pytest.approx(200, abs=1)


def test_a_range_finder_of_another_unit_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = SerialBench(monkeypatch)
    inches = bench.add('inches', 'maxbotix', {}, {'unit': 'inch'})
    metric = bench.add('metric', 'maxbotix', {'unit': 'cm'}, {'unit': 'mm'})
    bench.run(3)
    assert bench.errors('inches') == [
        'it sends 3 digits, which is not mm: set unit: cm or inch']
    assert bench.errors('metric') == ['it sends 4 digits, which is not cm: set unit: mm']
    assert DeviceState.ACTIVE not in (inches.state, metric.state)


def test_a_converter_without_the_channel_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = SerialBench(monkeypatch)
    bench.add('dut', 'sharp', {'channels': [4, 5]}, {'channels': 2})
    bench.run(3)
    assert bench.errors('dut')[0].startswith('it sends channel ')
    assert 'none of [4, 5]: set channels' in bench.errors('dut')[0]
    assert bench.devices['dut'].state is not DeviceState.ACTIVE


def test_another_scanner_is_told_with_what_to_set(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = SerialBench(monkeypatch)
    dut = bench.add('dut', 'hokuyo', {}, {'product': 'UTM-30LX'})
    bench.run(3)
    assert bench.errors('dut') == [
        'the settings do not fit: it is UTM-30LX(simulated), so set steps_per_turn: 1440, '
        'front_step: 540']
    assert dut.state is not DeviceState.ACTIVE


def test_a_receiver_that_refuses_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = SerialBench(monkeypatch)
    dut = bench.add('dut', 'ublox', {'configure': True}, {'refuses': True})
    bench.run(3)
    assert len(bench.errors('dut')) == 1
    assert bench.errors('dut')[0].startswith('it refuses CFG-MSG: lower output_rate_hz')
    assert dut.state is not DeviceState.ACTIVE


def test_frames_of_another_kind_are_a_warning_and_no_fault(
        monkeypatch: pytest.MonkeyPatch) -> None:
    bench = SerialBench(monkeypatch)
    dut = bench.add('dut', 'ublox', {}, {}, timeout_s=2.0)
    # A receiver as delivered: sentences, and no NAV-PVT.
    monkeypatch.setattr(bench.simulated['dut'], 'sample', lambda time_s: gga(
        datetime(2026, 1, 1, tzinfo=timezone.utc), 52.5, 13.4))
    bench.run(8)
    assert (dut.state, dut.faults) == (DeviceState.ACTIVE, 0)
    assert bench.errors('dut') == []
    assert_says(dut.statistics().reason, 'valid frames, but no sample for 3 s: it sends NMEA sent'
                                         'ences and no NAV-PVT: set configure: true')
    assert bench.take('dut/gps/fix') == 0


@pytest.mark.parametrize('sentences', [
    ['GGA'], ['GNS'], ['RMC'], ['GLL'], ['RMC', 'GLL'], ['RMC', 'GSA', 'GST'],
    ['GLL', 'RMC', 'GNS', 'GGA']], ids='-'.join)
def test_a_receiver_gives_its_fixes_whatever_it_sends(
        monkeypatch: pytest.MonkeyPatch, sentences: list[str]) -> None:
    bench = SerialBench(monkeypatch)
    dut = bench.add('dut', 'nmea', {'baud': 38400, 'output_rate_hz': 5.0},
                    {'rate_hz': 5.0, 'sentences': sentences})
    found: list[float] = []
    bench.watch['dut/gps/fix'] = lambda msg, stamp_ns: found.append(msg.latitude)
    bench.run(5)
    assert (dut.state, dut.faults, dut.statistics().reason) == (DeviceState.ACTIVE, 0, '')
    assert bench.take('dut/gps/fix') == pytest.approx(25, abs=2)
    assert all(latitude == pytest.approx(52.5163, abs=1e-3) for latitude in found)
