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


"""A thread in the core is noticed, and whose it is."""

from __future__ import annotations

from pathlib import Path
import signal
import threading
import time

from core_tools import Start
from processes import TIMEOUT_S
import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.core.threads import ThreadWatch
from rt_robot_os.link import LinkClient

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')


def test_a_thread_is_told_once_and_counts_while_it_lives() -> None:
    told: list[str] = []
    watch = ThreadWatch(told.append, {})
    watch.poll()
    ends = threading.Event()
    thread = threading.Thread(target=ends.wait, name='bad\x1bname')
    thread.start()
    for _ in range(3):
        watch.poll()
    assert len(watch.found) == len(told) == 1
    assert '\x1b' not in told[0] and 'of: unknown' in told[0]
    ends.set()
    thread.join()
    watch.poll()
    assert watch.found == []


def test_the_core_names_the_module_whose_thread_it_is(start: Start, folder: Path) -> None:
    process = start('timeout_s: 0', 'Threaded', prefix='core_thread_modules:')
    until = time.monotonic() + 60
    found: list[str] = []
    while not found and time.monotonic() < until and process.poll() is None:
        try:
            with LinkClient(folder / 'robot.sock', 'test', timeout_s=TIMEOUT_S) as client:
                found = client.statistics().core['threads']
        except LinkError:
            pass
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    errors = process.communicate(timeout=60)[1]
    assert found == ['side']
    assert errors.count("thread 'side' runs in the core (of: it, ") == 1
    assert 'core_thread_modules.py' in errors and 'in compute' in errors
