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

"""
Make the recordings of test/golden, once for each release: those of earlier ones stay as they are.

``PYTHONPATH=. .venv/bin/python scripts/golden_recordings.py test/golden/recordings/NEW``
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import tempfile
import time

from rt_robot_os.link import LinkClient
from rt_robot_os.settings import load
from rt_robot_os.settings import to_json
from rt_robot_os.topics import Layout

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / 'test' / 'golden' / 'recordings' / 'sources'
LENGTH_S = {'robot': 3.0, 'devices': 2.0}
LIMIT_S = 60.0


class Programs:
    """Starts programs of the package, in a runtime folder of their own."""

    def __init__(self, folder: Path) -> None:
        """Keep the folder."""
        text = (ROOT / 'setup.py').read_text(encoding='utf-8')
        self.folder = folder
        self._where = dict(re.findall(r"'(\w+) = ([\w.]+:\w+)'", text))
        self._environment = {
            **os.environ, 'RT_ROBOT_OS_RUNTIME_DIR': str(folder), 'OPENBLAS_NUM_THREADS': '1',
            'PYTHONPATH': os.pathsep.join([str(ROOT), str(SOURCES),
                                           os.environ.get('PYTHONPATH', '')])}

    def start(self, name: str, *arguments: str) -> subprocess.Popen[bytes]:
        """Start one; its output goes to NAME.log."""
        module, _, function = self._where[name].partition(':')
        code = f'import sys; from {module} import {function}; sys.exit({function}())'
        with self.log(name).open('wb') as stream:
            return subprocess.Popen([sys.executable, '-c', code, *arguments], stdout=stream,
                                    stderr=stream, env=self._environment, cwd=self.folder)

    def run(self, name: str, *arguments: str) -> None:
        """Run one to its end."""
        if self.start(name, *arguments).wait(LIMIT_S):
            sys.exit(self.log(name).read_text())

    def log(self, name: str) -> Path:
        """Give the file of its output."""
        return self.folder / f'{name}.log'


def wait_for(condition: Callable[[], object], what: str) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + LIMIT_S
    while not condition():
        if time.monotonic() > end:
            sys.exit(f'no {what} within {LIMIT_S:g} s')
        time.sleep(0.02)


def publish(socket: Path, name: str, length_s: float) -> None:
    """Be the one who commands, for so long."""
    topic = {'robot': 'cmd_vel', 'devices': 'cloud'}[name]
    with LinkClient(socket, 'golden') as client:
        channel = client.advertise(topic)
        end, number = time.monotonic() + length_s, 0
        while time.monotonic() < end:
            if topic == 'cmd_vel':
                layout = Layout.compile('geometry_msgs/msg/Twist')
                sample = layout.from_dict({'linear': {'x': number / 10},
                                           'angular': {'z': -number / 20}})
            else:
                layout = Layout.compile('std_msgs/msg/UInt8MultiArray', tail=512)
                sample = layout.from_dict({'data': bytes(range(number * 7 % 200))})
            client.publish(channel, sample)
            number += 1
            time.sleep(0.1)


def record(name: str, folder: Path, programs: Programs) -> None:
    """Record one robot from its first moment on; save what it did last, and a parameter."""
    settings = replace(load([SOURCES / f'{name}.yaml']), files=(f'{name}.yaml',))
    (programs.folder / 'settings.json').write_text(to_json(settings))
    recorder = programs.start('record', '-o', str(folder / name))
    wait_for(lambda: b'waiting' in programs.log('record').read_bytes(), 'waiting recorder')
    core = programs.start('core', '--settings', 'settings.json')
    try:
        socket = programs.folder / 'robot.sock'
        wait_for(lambda: socket.exists() or core.poll() is not None, 'core')
        publish(socket, name, LENGTH_S[name])
        recorder.send_signal(signal.SIGINT)
        recorder.wait(LIMIT_S)
        if name == 'robot':
            programs.run('black_box', 'dump', str(folder / 'stumbled.rtbb.gz'),
                         '--reason', 'golden')
            programs.run('parameters', 'set', 'imu.rate_hz', '150')
            programs.run('parameters', 'set', 'guard.timeout_s', '0.25')
            programs.run('parameters', 'save', str(folder / 'robot.saved.yaml'))
    finally:
        core.terminate()
        core.wait(LIMIT_S)
    print(programs.log('record').read_text().splitlines()[-1])


def main() -> int:
    """Make them all in a new folder."""
    folder = Path(sys.argv[1]).resolve()
    folder.mkdir(parents=True)
    sys.path.insert(0, str(SOURCES))
    for name in LENGTH_S:
        with tempfile.TemporaryDirectory(prefix='rtg') as runtime:
            record(name, folder, Programs(Path(runtime)))
    return 0


if __name__ == '__main__':
    sys.exit(main())
