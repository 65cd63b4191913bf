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


"""A child that asked for it ends with its parent."""

from __future__ import annotations

from collections.abc import Callable
import os
import subprocess

Runner = Callable[..., subprocess.CompletedProcess[str]]

# The grandchild says when it is ready, then waits for ever; the child ends without a word. The
# pipe ends when nobody holds its writing end any more: when the grandchild has ended.
CODE = """
import os, signal, sys
from rt_robot_os.linux.process import die_with_parent
reading, writing = os.pipe()
child = os.fork()
if not child:
    parent = os.getpid()
    if not os.fork():
        os.close(reading)
        assert die_with_parent(parent, signal.SIGKILL)
        os.write(writing, b'ready')
        signal.pause()
    os.close(writing)
    os.read(reading, 5)
    os._exit(0)
os.close(writing)
os.waitpid(child, 0)
while os.read(reading, 100):
    pass
print('gone')
"""


def test_a_child_ends_when_its_parent_does(run_code: Runner) -> None:
    done = run_code(CODE)
    assert (done.returncode, done.stdout, done.stderr) == (0, 'gone\n', '')


def test_a_parent_that_is_gone_already_is_noticed(run_code: Runner) -> None:
    done = run_code(f"""
from rt_robot_os.linux.process import die_with_parent
print(die_with_parent({os.getpid()}), die_with_parent(1), die_with_parent())
""")
    assert done.stdout == 'True False True\n'
