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

"""The command line of `doctor`, and what it and the configuration want of the machine."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
import sys
from typing import NoReturn
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.tools.doctor.report import FAILED
from rt_robot_os.tools.doctor.system import Wanted

if TYPE_CHECKING:
    from rt_robot_os.settings import RobotSettings
    from rt_robot_os.settings.run_on import MovingBoard

_EPILOG = """\
exit code: 0 ready: nothing to fix; 1 usable: a robot runs, with degraded latency or convenience;
2 not usable: it does not run, or not in time; 3 bad arguments, or the doctor itself failed;
130 Ctrl-C.

The doctor changes nothing. `doctor my_robot.yaml` checks the machine for that robot: its CPU, its
priority, its ports; so does `doctor --ros-args --params-file my_robot.yaml`."""
_LONGEST_S = 86400.0
# Its port is a folder, and nothing that is plugged in.
_JOURNAL = 'journal'


class _Parser(argparse.ArgumentParser):
    """Argument parser whose exit code for mistakes is not the one for "not usable"."""

    def error(self, message: str) -> NoReturn:
        self.print_usage(sys.stderr)
        self.exit(FAILED, f'{self.prog}: error: {message}\n')


@dataclass(frozen=True)
class Options:
    """
    What was requested.

    :ivar seconds: of the measurement; 0 for none.
    """

    everything: bool
    quiet: bool
    json: bool
    seconds: float


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not a number of seconds') from None
    if not 0.1 <= value <= _LONGEST_S:
        raise argparse.ArgumentTypeError(f'{text} is not from 0.1 to {_LONGEST_S:g}')
    return value


def _cpu(text: str) -> int:
    if not text.isdigit():
        raise argparse.ArgumentTypeError(f'{text!r} is not the number of a CPU')
    return int(text)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog='doctor', description='Is this machine ready for real time, and what to do about it.',
        epilog=_EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('files', nargs='*', type=Path, metavar='FILE',
                        help='parameter files of the robot that is to run here')
    amount = parser.add_mutually_exclusive_group()
    amount.add_argument('--all', action='store_true', dest='everything',
                        help='also what does not apply here, and why each line matters')
    amount.add_argument('--quiet', action='store_true', help='only what is to be mended')
    parser.add_argument('--json', action='store_true', help='all of it as JSON')
    parser.add_argument('--seconds', type=_seconds, default=10.0, metavar='N',
                        help='how long to measure wake-ups at the end (default %(default)g)')
    parser.add_argument('--no-wakeup', action='store_true', help='do not measure')
    parser.add_argument('--cpu', type=_cpu, metavar='N',
                        help='the CPU of the core, instead of core.cpu of the configuration')
    return parser


def _wanted(argv: Sequence[str], files: Sequence[Path], cpu: int | None) -> Wanted:
    """
    Read what the core would ask for.

    :raises ConfigError: the configuration that was named is wrong.
    """
    is_given = bool(argv or files)
    source = 'the given configuration' if is_given else 'the default configuration'
    try:
        from rt_robot_os.settings.load import load_from_arguments
        from rt_robot_os.settings.tasks import without_watchdog
        settings, _ = load_from_arguments(argv, files=files)
    except Exception as error:
        # Without arguments it is our own file: the installation is broken, a check reports how.
        if is_given or not isinstance(error, (ConfigError, ImportError, OSError)):
            raise
        default = Wanted()
        return Wanted(cpu=default.cpu if cpu is None else cpu, source='as usual; the '
                      'configuration cannot be read')
    ports = tuple(dict.fromkeys(device.port for device in settings.devices
                                if device.port.startswith('/') and device.type != _JOURNAL))
    if cpu is not None:
        source += ', --cpu'
    core = settings.core
    return Wanted(
        cpu=core.cpu if cpu is None else cpu, priority=core.scheduler_priority,
        lock_memory=core.lock_memory, ports=ports, cpu_latency_us=core.cpu_latency_us,
        spin_us=core.spin_us, watchdog=settings.watchdog.device,
        unwatched=without_watchdog(settings), black_box_folder=core.black_box_folder,
        journals=_journals(settings), boards=_boards(settings), source=source)


def _journals(settings: RobotSettings) -> tuple[tuple[str, int], ...]:
    from rt_robot_os.features.alarms.journal_device.worker import folder_of
    from rt_robot_os.features.alarms.journal_file import disk_bytes
    return tuple((str(folder_of(device.port)), disk_bytes(device.settings['limit_kb'] << 10))
                 for device in settings.devices if device.type == _JOURNAL
                 and device.sim is None)


def _boards(settings: RobotSettings) -> tuple[MovingBoard, ...]:
    from rt_robot_os.settings.run_on import moving_boards
    return moving_boards(settings)


def parse(argv: Sequence[str]) -> tuple[Options, Wanted]:
    """
    Read a command line.

    :raises SystemExit: for mistakes, with code 3, and after --help.
    :raises ConfigError: the configuration is wrong.
    """
    # Not by settings.ros_args: the doctor works where the settings cannot even be imported.
    given = list(argv)
    split = given.index('--ros-args') if '--ros-args' in given else len(given)
    arguments = _parser().parse_args(given[:split])
    options = Options(arguments.everything, arguments.quiet, arguments.json,
                      0.0 if arguments.no_wakeup else arguments.seconds)
    return options, _wanted(given[split:], arguments.files, arguments.cpu)
