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


"""What is written to a watchdog; a file and a pty stand for the hardware."""

from __future__ import annotations

import os
from pathlib import Path
import tty

from rt_robot_os.linux.machine_watchdog import open_machine_watchdog


def test_it_is_fed_and_stopped(tmp_path: Path) -> None:
    path = tmp_path / 'watchdog'
    path.touch()
    result, watchdog = open_machine_watchdog(path, 4)
    assert str(result) == f'watchdog {path}: active'
    assert watchdog is not None and watchdog.timeout_s == 0  # a file cannot tell
    watchdog.feed()
    watchdog.feed()
    watchdog.close()
    watchdog.close()
    watchdog.feed()
    assert path.read_bytes() == b'\0\0V'


def test_one_that_shall_strike_is_not_stopped(tmp_path: Path) -> None:
    path = tmp_path / 'watchdog'
    path.touch()
    _, watchdog = open_machine_watchdog(path, 4)
    assert watchdog is not None
    watchdog.feed()
    watchdog.close(stop=False)
    assert path.read_bytes() == b'\0'


def test_a_device_that_disappears_does_no_harm() -> None:
    control, port = os.openpty()
    tty.setraw(port)
    _, watchdog = open_machine_watchdog(Path(os.ttyname(port)), 4)
    assert watchdog is not None
    watchdog.feed()
    assert os.read(control, 1) == b'\0'
    os.close(control)
    watchdog.feed()
    watchdog.close()
    os.close(port)


def test_one_that_is_not_there_comes_with_a_remedy(tmp_path: Path) -> None:
    result, watchdog = open_machine_watchdog(tmp_path / 'none', 4)
    assert watchdog is None and not result.ok
    assert result.reason == ('No such file or directory. Remedy: load the driver of the hardware, '
                             'or softdog: modprobe softdog')
