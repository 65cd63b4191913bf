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


"""The request for CPU latency: what is written, how long it holds, and why it is refused."""

from __future__ import annotations

import os
from pathlib import Path
import struct

import pytest

from rt_robot_os.linux.realtime import DEVICE
from rt_robot_os.linux.realtime import request_cpu_latency


def _open_files(path: Path) -> int:
    folder = Path('/proc/self/fd')
    return sum(os.path.realpath(entry) == str(path) for entry in folder.iterdir())


def test_it_holds_as_long_as_it_is_kept(tmp_path: Path) -> None:
    path = tmp_path / 'cpu_dma_latency'
    path.touch()
    result, held = request_cpu_latency(20, path)
    assert str(result) == 'CPU latency 20 us: active'
    assert path.read_bytes() == struct.pack('=i', 20)
    assert held is not None and _open_files(path) == 1
    held.close()
    held.close()
    assert _open_files(path) == 0


def test_a_machine_without_it_says_so(tmp_path: Path) -> None:
    result, held = request_cpu_latency(0, tmp_path / 'none')
    assert held is None and not result.ok
    assert 'there is no ' in result.reason


def test_other_refusals_have_a_reason(tmp_path: Path) -> None:
    result, held = request_cpu_latency(0, tmp_path)
    assert held is None and not result.ok
    assert result.reason.endswith('Is a directory')


@pytest.mark.skipif(not os.access(DEVICE, os.R_OK | os.W_OK), reason=f'{DEVICE} is not accessible')
def test_linux_takes_it() -> None:
    result, held = request_cpu_latency(5)
    assert result.ok and held is not None
    with DEVICE.open('rb') as file:
        assert struct.unpack('=i', file.read(4))[0] <= 5
    held.close()
