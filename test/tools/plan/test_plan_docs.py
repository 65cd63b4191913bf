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

"""The worked example in the documentation is what `plan` says of its configuration."""

from __future__ import annotations

from pathlib import Path
import re
import shlex
import sys

import pytest

from rt_robot_os.ros.core_process import CoreProcess
from rt_robot_os.tools.plan.command import run

ROOT = Path(__file__).resolve().parents[3]
EXAMPLES = ROOT / 'docs' / 'examples'
# <!-- plan OPTIONS -- ROS ARGUMENTS | what the first line begins with ... and the last -->
BLOCK = re.compile(r'<!-- plan (.*?)\|.*?-->\n```text\n(.*?)```\n', re.DOTALL)
BLOCKS = BLOCK.findall((ROOT / 'docs' / 'choosing_priorities.md').read_text())

pytest.importorskip('sensor_msgs', reason='the ROS 2 message packages are not installed')


def courier(options: str) -> int:
    own, _, ros = f' {options} '.partition(' -- ')
    return run(['--measured', str(EXAMPLES / 'courier.json'), *shlex.split(own), '--ros-args',
                '--params-file', str(EXAMPLES / 'courier.yaml'), *shlex.split(ros)], CoreProcess)


@pytest.mark.parametrize(('options', 'text'), BLOCKS)
def test_the_example_says_what_plan_says(
        options: str, text: str, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, 'path', [str(EXAMPLES), *sys.path])
    code = courier(options)
    assert text.strip()
    assert text in capsys.readouterr().out
    assert code == (1 if 'not schedulable' in text else 0)


def test_there_are_examples_of_both() -> None:
    assert len(BLOCKS) >= 5
