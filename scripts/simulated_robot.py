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

"""A simulated robot of its own for the scripts that make pictures: folder, ROS domain, processes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import random
import signal
import subprocess
import sys
import tempfile
import time

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link import LinkClient
from rt_robot_os.linux.paths import socket_path

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / 'docs' / 'examples'
ROBOT = sys.executable, '-m', 'rt_robot_os.ros.program'
START_S = 60.0


@contextmanager
def robot(parameters: Path) -> Iterator[None]:
    """Run a robot by itself: a runtime folder and a ROS domain of its own."""
    with tempfile.TemporaryDirectory(prefix='rtp') as folder:
        os.environ |= {'RT_ROBOT_OS_RUNTIME_DIR': folder, 'ROS_LOG_DIR': f'{folder}/log',
                       'ROS_DOMAIN_ID': str(random.randint(1, 101)),
                       'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
                       'PYTHONPATH': os.pathsep.join([str(ROOT), str(EXAMPLES), os.environ.get(
                           'PYTHONPATH', '')])}
        process = subprocess.Popen(
            [*ROBOT, '--simulate', '--ros-args', '--params-file', str(parameters)],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            wait_for_devices()
            yield
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(30.0)


def wait_for_devices() -> None:
    """Wait until a robot's devices deliver."""
    deadline_s = time.monotonic() + START_S
    while time.monotonic() < deadline_s:
        try:
            client = LinkClient(socket_path('robot'), 'pictures')
        except LinkError:
            time.sleep(0.2)
            continue
        active = all(each['state'] == 'active' for each in client.statistics().devices)
        client.close()
        if active:
            return
        time.sleep(0.2)
    raise SystemExit('pictures: the robot did not start')
