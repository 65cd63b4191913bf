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

"""Do recorded scans come out of the driver as they stand in the file, at their times."""

from __future__ import annotations

import math
import os
from pathlib import Path
import subprocess
import sys

from driver_fakes import bind
from driver_fakes import data_file
from driver_fakes import settings_of
from driver_fakes import wait_readable
import numpy as np
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.devices.hokuyo.driver import Hokuyo
from rt_robot_os.devices.hokuyo.scan_log import by_scan_time
from rt_robot_os.sim.player import load_log
from rt_robot_os.sim.player import Player
from rt_robot_os.sim.pty_port import PtyPort

S = 1_000_000_000
ROW = [0] * 24 + [1000 + i for i in range(682)]


def row(time_us: int, *, changes: dict[int, str] | None = None, columns: int = 706) -> bytes:
    values = [str(v) for v in ROW[:columns]]
    values[0] = str(time_us)
    for column, text in (changes or {}).items():
        values[column] = text
    return ' '.join(values).encode() + b'\n'


def test_every_recorded_scan_comes_out_of_the_driver_as_it_is_in_the_file(tmp_path: Path) -> None:
    path = data_file('lidar/exp1.dat')
    table = np.array([[float(v) for v in line.split()[:706]]
                      for line in path.read_text().splitlines()])
    port = PtyPort(tmp_path / 'laser')
    player = Player(by_scan_time(load_log(path)), port, 0)
    player.port.plug()
    device = Hokuyo('laser', settings_of(Hokuyo, port=str(port.link), baud=0, configure=False))
    publisher, = bind(device)
    device.open()
    now_ns = S
    while not player.done:
        player.pump(now_ns)
        while device.statistics().bytes_read < port.bytes_sent:
            wait_readable(device)
            device.read(now_ns)
        now_ns = max(now_ns + 1, player.next_event_ns())
    device.close()
    player.close()
    statistics = device.statistics()
    assert (statistics.samples, statistics.rejected_bytes) == (756, 0)
    assert port.bytes_dropped == 0
    stamps = np.array(publisher.stamps)
    assert np.abs((stamps - stamps[0]) - (table[:, 0] - table[0, 0]) * 1000).max() < 10
    ranges = np.array([sample.ranges for sample in publisher.samples])
    distances = table[:, 24:]
    measured = distances >= 20
    assert np.array_equal(np.round(ranges[measured] * 1000), distances[measured])
    assert np.all(ranges[distances == 0] == math.inf)
    assert np.all(np.isnan(ranges[(distances > 0) & ~measured]))
    assert measured.mean() > 0.4


def test_times_are_those_of_the_log_from_the_first_scan_on() -> None:
    pieces = by_scan_time([row(5_000_000), row(5_100_000), b'\n', row(5_100_000)])
    assert [offset for offset, _ in pieces] == [0, S // 10, S // 10]


@pytest.mark.parametrize('lines, message', [
    ([row(1), row(2, columns=700)], 'scan 2 has 700 columns: at least 706 are needed'),
    ([row(1, changes={30: 'x'})], "scan 1: .*'x'.*: times and distances are integers"),
    ([row(1, changes={30: '-5'})], 'scan 1: a time or distance is negative'),
    ([row(1, changes={30: '999999'})], 'beyond 262143 mm'),
    ([row(2), row(1)], 'scan 2: its time 1 us is before'), ([b'\n'], 'the log contains no scan')])
def test_a_log_of_another_format_is_refused(lines: list[bytes], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        by_scan_time(lines)


def test_the_program_plays_scans(tmp_path: Path) -> None:
    log = tmp_path / 'scans.dat'
    log.write_bytes(row(1_000_000) + row(1_010_000))
    link = tmp_path / 'laser'
    program = subprocess.Popen(
        [sys.executable, '-c', 'from rt_robot_os.sim.player_program import main; exit(main())',
         str(log), '--link', str(link), '--scans', '--wait'],
        stdout=subprocess.PIPE, text=True, env={**os.environ, 'PYTHONUNBUFFERED': '1'})
    try:
        assert program.stdout is not None and program.stdout.readline().strip() == str(link)
        device = Hokuyo('laser', settings_of(Hokuyo, port=str(link), configure=False))
        publisher, = bind(device)
        device.open()
        while len(publisher.samples) < 2:
            wait_readable(device, 20.0)
            device.read(1)
        device.close()
        assert program.wait(60) == 0
    finally:
        program.kill()
        program.wait()
        assert program.stdout is not None
        program.stdout.close()
    assert publisher.samples[1].ranges[:2].tolist() == pytest.approx([1.0, 1.001])
