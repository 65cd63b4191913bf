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

"""The monitor as a program: how it ends."""

from __future__ import annotations

from pathlib import Path
import signal
import subprocess
import sys

import pytest

pytest.importorskip('uvicorn')
pytest.importorskip('fastapi')


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_and_is_no_failure(tmp_path: Path, number: signal.Signals) -> None:
    command = [sys.executable, '-m', 'rt_robot_os.monitor.program', '--port', '0', '--folder',
               str(tmp_path / 'monitor')]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as monitor:
        assert monitor.stderr is not None
        said = ''
        while 'setup/' not in said:
            line = monitor.stderr.readline()
            assert line, said
            said += line
        monitor.send_signal(number)
        said += monitor.stderr.read()
    assert monitor.returncode == 0, said
    assert 'Traceback' not in said
