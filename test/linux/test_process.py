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


"""A child is started and ended in order, and ends with its parent when it asked for that."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import signal
import subprocess

import pytest
from rt_robot_os.linux.process import end_child
from rt_robot_os.linux.process import start_child

Runner = Callable[..., subprocess.CompletedProcess[str]]

# The grandchild says when it is ready, then waits for ever; the child ends without a word. The
# pipe ends when its writing end is closed everywhere: when the grandchild has ended.
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


MODULE = """
import os, signal, sys
from rt_robot_os.linux.process import run_child

def main(arguments):
    if arguments[0] == 'stubborn':
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    print(*arguments, len(sys.stdin.read()), os.getsid(0) == os.getpid(), flush=True)
    signal.pause()

sys.exit(run_child(main))
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Make a module that a child can be, and give its name."""
    (tmp_path / 'some_child.py').write_text(MODULE)
    places = [str(tmp_path), str(Path(__file__).parents[2]), os.environ.get('PYTHONPATH', '')]
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(places))
    return 'some_child'


@pytest.mark.parametrize(('word', 'signo'), [
    ('ordinary', signal.SIGTERM), ('stubborn', signal.SIGKILL)])
def test_a_child_gets_what_it_is_given_and_is_ended(
        module: str, word: str, signo: signal.Signals) -> None:
    child = start_child(module, os.getpid(), word, given=b'x' * 200_000, stdout=subprocess.PIPE)
    assert child.stdout is not None
    with child.stdout as said:
        # Ctrl-C in a terminal is for those of its foreground group: not for this session.
        assert said.readline() == f'{word} 200000 True\n'.encode()
        end_child(child, 0.2 if word == 'stubborn' else 60.0)
    assert child.returncode == -signo
    end_child(child, 0.0)


def test_a_child_that_ends_before_it_reads_is_no_error() -> None:
    child = start_child('no_such_module', given=b'x' * 1_000_000, stderr=subprocess.DEVNULL)
    assert child.wait(60) == 1


def test_a_child_whose_parent_has_gone_does_nothing(module: str) -> None:
    assert start_child(module, 1, 'ordinary').wait(60) == 0
