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

"""The sink and its simulated device on the virtual clock: faults, and each packet comes once."""

from __future__ import annotations

from collections import Counter

import pytest

from rt_robot_os.devices.state import DeviceState
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from serial_bench import SerialBench

pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')

CLASSES = ('alarm', 'vital', 'rest')
QUIET_S = 3.0


class Bench(SerialBench):
    """A robot with a sink, and every packet that it hands on."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **settings: object) -> None:
        super().__init__(monkeypatch)
        self.packets: list[bytes] = []
        self.dut = self.add('sink', 'sink', {'quiet_s': QUIET_S, **settings}, {
            'period_ms': 250.0, **{key: settings[key] for key in ('stack', 'mode')
                                   if key in settings}})
        for name in CLASSES:
            self.watch[f'sink/wsn/packets/{name}'] = (
                lambda message, stamp_ns: self.packets.append(bytes(message.data)))

    def form(self) -> None:
        """Run until some packets have come: the nodes know their ways to the sink."""
        self.packets.clear()
        for _ in range(30):
            self.run(1)
            if len(self.packets) > 10:
                return
        raise AssertionError(f'{len(self.packets)} packets in 30 s')


@pytest.mark.parametrize('fault, said', [
    ('silent', 'silent for 3 s: check that the mote is plugged in'),
    ('reset', 'silent for 3 s: check that the mote is plugged in'),
    ('baud', 'no valid frame for 1 s: check the baud rate (57600 under TinyOS 1.x'),
    ('wrong', 'no valid frame for 1 s: these are NMEA 0183 sentences at 57600 baud'),
    ('unplug', 'port sink is gone: check the cable')])
def test_a_fault_is_told_and_the_sink_comes_back(
        fault: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    bench.form()
    before = len(bench.errors('sink'))
    bench.simulated['sink'].inject(fault, 3.8)
    bench.run(3.8)
    assert said in bench.errors('sink')[before]
    bench.form()
    assert bench.dut.state is DeviceState.ACTIVE
    assert not bench.kernel.failures


def test_noise_costs_packets_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    bench.form()
    bench.simulated['sink'].inject('corrupt', 3.0)
    bench.run(3)
    bench.form()
    statistics = bench.dut.statistics()
    assert statistics.device.rejected_frames > 0
    assert statistics.state is DeviceState.ACTIVE
    assert not bench.kernel.failures


@pytest.mark.parametrize('stack, mode', [
    ('tinyos1', 'root'), ('tinyos1', 'sniffer'), ('tinyos2', 'root'), ('tinyos2', 'sniffer')])
def test_each_packet_comes_once(stack: str, mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch, stack=stack, mode=mode)
    bench.run(14)
    decoder = PacketDecoder(stack)
    found = [decoder.decode(each) for each in bench.packets]
    data = Counter((each.origin, each.origin_seqno, each.count) for each in found
                   if each.kind == 'data')
    assert len({origin for origin, _, _ in data}) >= 3
    assert set(data.values()) == {1}
    device = bench.dut.statistics().device
    assert (device.rejected_bytes, device.lost_samples) == (0, 0)
    assert device.more['unknown_types'] == device.more['foreign_groups'] == 0
    if mode == 'sniffer':
        assert any(each.kind == 'beacon' for each in found)
        assert device.more['duplicates'] > 0
