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
How every program begins and ends.

A program is a ``program.py`` (``NAME_program.py`` where a part has several) with ``main``, which
imports nothing that is slow, and a ``command.py`` beside it with what it does with its command
line. A :class:`Program` brings the two together.
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
# A wrong command line or configuration: nothing was begun.
BAD_USE: Final = 2
# What a shell says of a program that SIGINT or SIGPIPE has ended.
INTERRUPTED: Final = 128 + signal.SIGINT
READER_GONE: Final = 128 + signal.SIGPIPE

# What ends a program in order.
END_SIGNALS: Final = (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)

# NumPy's libraries start threads, which only take memory where one thread does all, and CPUs from
# the core where it does not. They look at this once, when they are imported.
ONE_BLAS_THREAD: Final = {
    'OPENBLAS_NUM_THREADS': '1', 'OMP_NUM_THREADS': '1', 'MKL_NUM_THREADS': '1'}

# Set where this process runs one program and ends with it.
_one_program = False

# Takes the arguments without the program's name, gives the exit code.
Run = Callable[[Sequence[str]], int]


@dataclass(frozen=True)
class Program:
    """
    The ``main`` of a program: what it runs is imported when it is called, and not before.

    :param name: of the program.
    :param command: what runs it, as ``package.module:function``.
    :param listens: as for :func:`run_program`.
    :param reader_gone: as well.
    :param one_thread: NumPy has no threads in it.
    """

    name: str
    command: str
    listens: bool = False
    reader_gone: int = READER_GONE
    one_thread: bool = False

    def load(self) -> Run:
        """Import what runs it."""
        module, _, function = self.command.partition(':')
        run: Run = getattr(import_module(module), function)
        return run

    def __call__(self, argv: Sequence[str] | None = None) -> int:
        """Run it; the arguments are those of the process unless they are given."""
        if self.one_thread:
            os.environ.update(ONE_BLAS_THREAD)
        return run_program(self.name, self.load, argv, listens=self.listens,
                           reader_gone=self.reader_gone)


def run_program(name: str, load: Callable[[], Run], argv: Sequence[str] | None = None, *,
                listens: bool = False, reader_gone: int = READER_GONE) -> int:
    """
    Run a program to its end, whatever ends it.

    Ctrl-C ends it at once and in silence while it is loaded, and then with code 130; a reader who
    has enough (``| head``) ends it in silence, too; an error of this package or of the system that
    comes up to here is told in one line, with exit code 1; a compiled build that is demanded and
    not there, with 2.

    :param load: imports what the program needs and gives what runs it.
    :param argv: the arguments; None takes those of the process, which ends with the program.
    :param listens: it listens to signals itself, and Ctrl-C ends it at once until it does.
    :param reader_gone: the exit code when nobody reads on.
    :return: the exit code.
    """
    end_quietly()
    try:
        with own_process() if argv is None else nullcontext():
            with importing():
                run = load()
            if not listens:
                raise_again()
            code = run(sys.argv[1:] if argv is None else argv)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        return reader_gone
    except (RtRobotError, OSError) as error:
        tell(name, error)
        return FAILED
    except ImportError as error:
        if error.name != EXTENSION:
            raise
        tell(name, error)  # a build was demanded that is not there
        return BAD_USE
    finally:
        _let_go_of_output()
        if argv is None:
            end_quietly()  # a traceback of an interpreter that ends helps nobody
        else:
            raise_again()


def tell(name: str, what: object, details: Iterable[str] = ()) -> None:
    """
    Write on standard error what is wrong; does nothing when nobody reads there any more.

    :param name: of the program.
    :param details: a line each below it.
    """
    with suppress(BrokenPipeError):
        print(f'{name}: {what}', *(f'  {each}' for each in details), sep='\n', file=sys.stderr,
              flush=True)


def run_command(name: str, description: str, commands: Iterable[Any], argv: Sequence[str]) -> int:
    """
    Run one of the commands of a program.

    :param commands: modules with ``add_to``, which adds a parser and what runs it, in the order in
        which the help names them.
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
        tell(name, error.problems[0], error.problems[1:])
        return BAD_USE


def command_line(program: str) -> str:
    """Return what starts a program of this package here: with ROS 2, or in a clone without."""
    import shutil
    return ('ros2 run rt_robot_os ' if shutil.which('ros2') else './scripts/run ') + program


def end_quietly() -> None:
    """
    Let Ctrl-C end this process at once and without a traceback, as it ends most programs.

    For what takes long to import, where there is nothing to put in order yet.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def raise_again() -> None:
    """Have Ctrl-C raise KeyboardInterrupt, as Python does."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def importing() -> Iterator[None]:
    """
    Import much at once, a tenth faster in a process of one program (:func:`own_process`).

    Hardly anything that is made by an import ever becomes garbage: the collector does not look
    through it meanwhile, nor later.
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

    :param end: takes the number of the signal.
    """
    def note(signum: int, frame: FrameType | None) -> None:
        end(signum)

    previous = {signo: signal.signal(signo, note) for signo in END_SIGNALS}
    try:
        yield
    finally:
        for signo, handler in previous.items():
            signal.signal(signo, signal.SIG_IGN if _one_program else handler)


def _let_go_of_output() -> None:
    """Write what is left; where nobody reads it, keep the interpreter from trying at its end."""
    try:
        sys.stdout.flush()
    except OSError:
        with suppress(OSError):  # replaced by something that is no file
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
