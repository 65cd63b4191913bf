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

"""The journal on a small file system that is really full."""

from __future__ import annotations

from collections.abc import Iterator
import errno
import os
from pathlib import Path
import signal
import subprocess
import time

from journal_rig import Rig
from journal_rig import worker_of
import pytest

from rt_robot_os.base.errors import DeviceError

pytest.importorskip('std_msgs.msg', reason='the ROS 2 messages are not installed')

LIMIT_KB = 64


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """Mount a file system of 512 KiB."""
    if os.geteuid():
        pytest.skip('only root may mount a small file system')
    mounted = subprocess.run(['mount', '-t', 'tmpfs', '-o', 'size=512k', 'tmpfs', tmp_path],
                             capture_output=True, check=False)
    if mounted.returncode:
        pytest.skip(f'no file system can be mounted here: {mounted.stderr.decode().strip()}')
    yield tmp_path
    subprocess.run(['umount', '-l', tmp_path], check=True)


def fill(disk: Path) -> Path:
    """Take all that is left of a disk."""
    with open(disk / 'filler', 'wb', buffering=0) as file:
        for size in (4096, 1):
            try:
                while True:
                    file.write(bytes(size))
            except OSError as error:
                assert error.errno == errno.ENOSPC
    return disk / 'filler'


def asked(rig: Rig, low: bool) -> str:
    """Ask the process until it says that the disk is full, or is no longer."""
    def is_told() -> bool:
        rig.device.write(time.monotonic_ns() + 10 ** 12)
        return any(bool(each['low']) is low for each in rig.said if 'low' in each)

    rig.until(is_told)
    return str([each['low'] for each in rig.said if 'low' in each][-1])


def test_alarms_outlive_a_kill_while_the_disk_is_full(disk: Path) -> None:
    one = Rig(disk / 'alarms', limit_kb=LIMIT_KB)
    try:
        one.begin()
        one.keep(1)
        one.until_stored(1)
        assert asked(one, False) == ''
        filler = fill(disk)
        for seq in range(2, 6):
            one.keep(seq)
            one.until_stored(seq)
            os.kill(worker_of(one), signal.SIGKILL)
            with pytest.raises(DeviceError, match='ended without a message'):
                one.until(lambda: False)
            one.device.close()
            fill(disk)  # of what a new file has freed nothing is left
            assert one.begin() == [str(each) for each in range(1, seq + 1)]
        assert asked(one, True).startswith('No space left on device: alarms are stored in the ')
        statistics = one.device.statistics().more
        assert 0 < int(str(statistics['kept_kb'])) <= 2 * LIMIT_KB
        assert 'make room on the disk' in str(statistics['warning'])
        # It is used up: that is told as before, and what was stored stays.
        seq = 5
        with pytest.raises(DeviceError, match='cannot be written: No space left on device'):
            while seq < 5000:
                seq += 1
                one.keep(seq, 'long', text='x' * 2000)
                one.until_stored(seq)
        assert seq > 20
        one.device.close()
        filler.unlink()
        assert one.begin() == ['1', '2', '3', '4', '5', 'long']
        one.said.clear()
        assert asked(one, False) == ''
        one.keep(seq)
        one.until_stored(seq)
    finally:
        one.device.close()
