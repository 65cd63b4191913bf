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
The start and the end of every program.

A program consists of ``program.py`` (``NAME_program.py`` where a part has several), whose ``main``
imports nothing slow, and ``command.py`` in the same folder, which processes the command line.
:class:`Program` connects the two.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Sequence
from contextlib import contextmanager
from contextlib import nullcontext
from contextlib import suppress
from dataclasses import dataclass
import gc
from importlib import import_module
import os
import signal
import sys
from types import FrameType
from typing import Any
from typing import Final

from rt_robot_os.base.compiled import EXTENSION
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import RtRobotError

OK: Final = 0
FAILED: Final = 1
# A wrong command line or configuration: nothing was started.
BAD_USE: Final = 2
# Exit codes of a shell for a program that SIGINT or SIGPIPE has ended.
INTERRUPTED: Final = 128 + signal.SIGINT
BROKEN_PIPE: Final = 128 + signal.SIGPIPE

# Signals that end a program in order.
END_SIGNALS: Final = (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)

# NumPy's libraries start threads, which waste memory in single-threaded programs and take CPUs
# from the core in others. They read these variables once, when they are imported.
ONE_BLAS_THREAD: Final = {
    'OPENBLAS_NUM_THREADS': '1', 'OMP_NUM_THREADS': '1', 'MKL_NUM_THREADS': '1'}

# Set when this process runs one program and ends with it.
_one_program = False

# Called with the arguments without the program's name, returns the exit code.
Run = Callable[[Sequence[str]], int]


@dataclass(frozen=True)
class Program:
    """
    The ``main`` of a program: its code is imported only when it is called.

    :param name: of the program.
    :param command: its function, as ``package.module:function``.
    :param handles_signals: as for :func:`run_program`.
    :param broken_pipe_code: as for :func:`run_program`.
    :param one_thread: NumPy uses no threads in it.
    """

    name: str
    command: str
    handles_signals: bool = False
    broken_pipe_code: int = BROKEN_PIPE
    one_thread: bool = False

    def load(self) -> Run:
        """Import the function of the program."""
        module, _, function = self.command.partition(':')
        run: Run = getattr(import_module(module), function)
        return run

    def __call__(self, argv: Sequence[str] | None = None) -> int:
        """Run it, by default with the arguments of the process."""
        if self.one_thread:
            os.environ.update(ONE_BLAS_THREAD)
        return run_program(self.name, self.load, argv, handles_signals=self.handles_signals,
                           broken_pipe_code=self.broken_pipe_code)


def run_program(name: str, load: Callable[[], Run], argv: Sequence[str] | None = None, *,
                handles_signals: bool = False, broken_pipe_code: int = BROKEN_PIPE) -> int:
    """
    Run a program, and translate every end of it to an exit code.

    While the program is being loaded, Ctrl-C ends it immediately without a message, afterwards
    with code 130. A closed output (``| head``) ends it without a message. An error of this package
    or of the system is printed in one line, with exit code 1; a missing compiled build that is
    required, with 2.

    :param load: imports the code of the program and returns the function that runs it.
    :param argv: the arguments; None takes those of the process, which ends with the program.
    :param handles_signals: it installs its own handlers; until then Ctrl-C ends it immediately.
    :param broken_pipe_code: the exit code when its output is closed.
    :return: the exit code.
    """
    restore_default_sigint()
    try:
        with own_process() if argv is None else nullcontext():
            with importing():
                run = load()
            if not handles_signals:
                raise_on_sigint()
            code = run(sys.argv[1:] if argv is None else argv)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        return broken_pipe_code
    except (RtRobotError, OSError) as error:
        warn(name, error)
        return FAILED
    except ImportError as error:
        if error.name != EXTENSION:
            raise
        warn(name, error)  # a required build is missing
        return BAD_USE
    finally:
        _flush_output()
        if argv is None:
            restore_default_sigint()  # no traceback while the interpreter ends
        else:
            raise_on_sigint()


def warn(name: str, what: object, details: Iterable[str] = ()) -> None:
    """
    Print a problem on standard error; does nothing when that is closed.

    :param name: of the program.
    :param details: further lines.
    """
    with suppress(BrokenPipeError):
        print(f'{name}: {what}', *(f'  {each}' for each in details), sep='\n', file=sys.stderr,
              flush=True)


def run_command(name: str, description: str, commands: Iterable[Any], argv: Sequence[str]) -> int:
    """
    Run one of the subcommands of a program.

    :param commands: modules with ``add_to``, which adds a parser and its function, in the order of
        the help.
    :param argv: without the program's name.
    :return: the exit code.
    :raises RtRobotError: it failed.
    """
    import argparse
    parser = argparse.ArgumentParser(prog=name, allow_abbrev=False, description=description)
    parsers = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    for each in commands:
        each.add_to(parsers)
    arguments = parser.parse_args(argv)
    try:
        return int(arguments.run(arguments))
    except ConfigError as error:
        warn(name, error.problems[0], error.problems[1:])
        return BAD_USE


def command_line(program: str) -> str:
    """Return the command that starts a program here: with ROS 2, or in a clone without it."""
    import shutil
    return ('ros2 run rt_robot_os ' if shutil.which('ros2') else './scripts/run ') + program


def restore_default_sigint() -> None:
    """
    Have Ctrl-C end this process immediately and without a traceback.

    For long imports, where there is nothing to clean up yet.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def raise_on_sigint() -> None:
    """Have Ctrl-C raise KeyboardInterrupt, as Python does."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def importing() -> Iterator[None]:
    """
    Import many modules, 10 % faster in a process of one program (:func:`own_process`).

    Objects that an import makes hardly ever become garbage: the garbage collector is off meanwhile
    and ignores them later.
    """
    if not _one_program:
        yield
        return
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if collects:
            gc.enable()


@contextmanager
def own_process() -> Iterator[None]:
    """Declare that this process runs one program and ends after it."""
    global _one_program
    before, _one_program = _one_program, True
    try:
        yield
    finally:
        _one_program = before


@contextmanager
def ended_by_signals(end: Callable[[int], object]) -> Iterator[None]:
    """
    Have :data:`END_SIGNALS` call a function.

    Afterwards they are ignored in a process of one program (:func:`own_process`), which is about
    to end: a parent may request the end twice, by a closed pipe and by a signal, and the default
    action of the second request would skip the clean-up and falsify the exit code. In any other
    process the previous handlers are restored.

    :param end: called with the number of the signal.
    """
    def note(signum: int, frame: FrameType | None) -> None:
        end(signum)

    previous = {signo: signal.signal(signo, note) for signo in END_SIGNALS}
    try:
        yield
    finally:
        for signo, handler in previous.items():
            signal.signal(signo, signal.SIG_IGN if _one_program else handler)


def _flush_output() -> None:
    """Flush the output; if it is closed, keep the interpreter from trying again at its end."""
    try:
        sys.stdout.flush()
    except OSError:
        with suppress(OSError):  # replaced by an object that is not a file
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
