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

"""Every program begins and ends in the same way, whatever ends it."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Sequence
import gc
import os
from pathlib import Path
import re
import signal
import subprocess
import sys

import pytest

from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.programs import ended_by_signals
from rt_robot_os.base.programs import run_program
import setup_programs

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = {name: target.removesuffix(':main')
            for name, target in setup_programs.PROGRAMS.items()}
# Ctrl-C when the first module is imported that is not there for the beginning alone.
INTERRUPTED = """
import os, signal, sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name.endswith('command') or name.startswith('numpy'):
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
from {} import main
sys.exit(main())
"""

# What takes a tenth of a second or more to import, or much memory.
HEAVY = ('fastapi', 'matplotlib', 'mcap', 'numpy', 'PIL', 'pydantic', 'rclpy', 'rich', 'scipy',
         'sqlalchemy', 'rt_robot_os.topics')
# Their commands are declared beside what computes, or their help lists what has to be imported.
HEAVY_HELP = {'bench', 'health', 'plan', 'rehearse'}


def start(code: str, *arguments: str, **options: object) -> subprocess.Popen[str]:
    """Start a Python that finds this package."""
    return subprocess.Popen(  # type: ignore[call-overload, no-any-return]
        [sys.executable, '-c', code, *arguments], text=True, stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL, env={**os.environ, 'OPENBLAS_NUM_THREADS': '1',
                                       'PYTHONPATH': os.pathsep.join(
                                           [str(ROOT), os.environ.get('PYTHONPATH', '')])},
        **options)


@pytest.fixture
def nobody_reads() -> Iterator[int]:
    """Give an output that nobody reads."""
    reading, writing = os.pipe()
    os.close(reading)
    yield writing
    os.close(writing)


@pytest.mark.parametrize('program', sorted(PROGRAMS))
def test_ctrl_c_while_it_loads_ends_it_in_silence(program: str) -> None:
    process = start(INTERRUPTED.format(PROGRAMS[program]))
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (-signal.SIGINT, '')


@pytest.mark.parametrize('program', sorted(PROGRAMS.keys() - HEAVY_HELP))
def test_help_imports_nothing_heavy(program: str) -> None:
    process = start(f"""
import sys
from {PROGRAMS[program]} import main
try:
    main(['--help'])
except SystemExit as end:
    assert not end.code, end
print(*(name for name in {HEAVY} if name in sys.modules), file=sys.stderr)
""", stdout=subprocess.DEVNULL)
    assert process.communicate(timeout=60)[1].split() == []


def test_what_a_program_imports_is_no_work_for_the_collector_of_garbage() -> None:
    process = start("""
import gc, sys
from rt_robot_os.base.programs import run_program
def load():
    global seen
    seen = gc.isenabled()
    return run
def run(argv):
    print(seen, gc.isenabled(), gc.get_freeze_count() > 1000, file=sys.stderr)
    return 0
run_program('test', load)
""")
    assert process.communicate(timeout=60)[1].split() == ['False', 'True', 'True']


def test_a_program_that_is_called_leaves_the_collector_of_garbage_alone() -> None:
    before = gc.isenabled(), gc.get_freeze_count()
    seen = []

    def load() -> Callable[[Sequence[str]], int]:
        seen.append(gc.isenabled())
        return lambda argv: 0

    assert run_program('test', load, []) == 0
    assert seen == [before[0]] and before == (gc.isenabled(), gc.get_freeze_count())


def raising(error: BaseException) -> Callable[[], Callable[[Sequence[str]], int]]:
    def run(argv: Sequence[str]) -> int:
        raise error

    return lambda: run


@pytest.mark.parametrize(('error', 'code', 'said'), [
    (KeyboardInterrupt(), 130, ''), (BrokenPipeError(), 141, ''),
    (RtRobotError('imu: no such port'), 1, 'test: imu: no such port\n'),
    (OSError(28, 'No space left on device'), 1, 'test: [Errno 28] No space left on device\n')])
def test_what_ends_it_is_its_exit_code(
        error: BaseException, code: int, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_program('test', raising(error), []) == code
    assert capsys.readouterr() == ('', said)


def test_a_mistake_in_the_code_is_no_message_for_users() -> None:
    with pytest.raises(ZeroDivisionError):
        run_program('test', raising(ZeroDivisionError()), [])


def test_its_own_exit_code_is_kept_and_ctrl_c_is_as_before() -> None:
    before = signal.getsignal(signal.SIGINT)
    seen = []

    def run(argv: Sequence[str]) -> int:
        seen.append((list(argv), signal.getsignal(signal.SIGINT)))
        return 3

    assert run_program('test', lambda: run, ['--all']) == 3
    assert run_program('test', lambda: run, [], listens=True) == 3
    assert seen == [(['--all'], before), ([], signal.SIG_DFL)]
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize(('program', 'arguments', 'code'), [
    ('plan', ['--help'], 0), ('bench', ['--list'], 1),
    ('black_box', ['--folder', 'none', 'list'], 0)])
def test_a_reader_that_has_enough_ends_it_in_silence(
        program: str, arguments: list[str], code: int, nobody_reads: int) -> None:
    process = start(f'import sys; from {PROGRAMS[program]} import main; sys.exit(main())',
                    *arguments, stdout=nobody_reads)
    assert process.communicate(timeout=60)[1] == ''
    assert process.returncode == code


def test_a_simulator_whose_paths_nobody_reads_leaves_none(
        tmp_path: Path, nobody_reads: int) -> None:
    process = start(f'import sys; from {PROGRAMS["simulator"]} import main; sys.exit(main())',
                    'imu:witmotion', '--dir', str(tmp_path), stdout=nobody_reads)
    assert process.communicate(timeout=60)[1] == ''
    assert process.returncode == 141
    assert not any(path.is_symlink() for path in tmp_path.iterdir())


def test_signals_call_what_ends_a_program_and_are_as_before_afterwards() -> None:
    before = [signal.getsignal(signo) for signo in (
        signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    ended: list[int] = []
    with ended_by_signals(ended.append):
        for signo in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.raise_signal(signo)
    assert ended == [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
    assert before == [signal.getsignal(signo) for signo in (
        signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]


TIDIES_UP = """
import os, signal, sys
from rt_robot_os.base.programs import ended_by_signals
from rt_robot_os.base.programs import run_program
from rt_robot_os.linux.process import run_child

def run(arguments):
    with ended_by_signals(lambda signo: None):
        pass
    for signo in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT):
        signal.raise_signal(signo)
    return 0

sys.exit(MAIN)
"""


@pytest.mark.parametrize('main', ["run_program('test', lambda: run, listens=True)",
                                  'run_child(run)'])
def test_a_second_request_to_end_does_not_interrupt_the_clean_up(main: str) -> None:
    """A child of which the parent closes the pipe and sends SIGTERM as well ends with code 0."""
    process = start(TIDIES_UP.replace('MAIN', main), str(os.getpid()))
    assert process.communicate(timeout=60)[1] == ''
    assert process.returncode == 0
