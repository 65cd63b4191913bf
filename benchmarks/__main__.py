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
One command for all benchmarks and measurements: ``./scripts/bench NAME ...``.

A command (``benchmarks/commands``) gets the arguments behind its name; everything else goes to the
program `bench`, which measures cases. Without arguments all names are listed.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import runpy
import sys

from rt_robot_os.tools.bench import program
from rt_robot_os.tools.bench.registry import CASES

#: What each measures; README.md shows the same lines.
COMMANDS: Mapping[str, str] = {
    'attitude_comparison': 'attitude filters on recordings, compared with those of other packages',
    'compare_trees': 'small costs of the kernel in two trees, both builds, and bare loops',
    'first_sample': 'how long a newcomer waits from a fresh clone to the first sample',
    'load_monitor': 'a server of the monitor under load, as JSON',
    'mapping_accuracy': 'the tables of docs/mapping_accuracy.md, from recorded logs',
    'measure_drive': "teleoperation: from the page to the motor's wire, stopping after failures",
    'measure_media': 'the age of pictures on the screen, the delay of a voice',
    'measure_page': 'the page: size, time until usable, smoothness of six plots, as JSON',
    'measure_plots': 'plots of the data view: frames a second while live, time to show a year',
    'measure_start': 'from the start of a robot to its first message in ROS 2, step by step',
    'measure_store': 'the database of the monitor, as JSON',
    'typical_times': 'execution times of the shipped drivers and modules, for `plan`',
}
_PACKAGES = ('attitude_comparison',)


def module_of(command: str) -> str:
    """Return the module that a command runs as ``__main__``."""
    return f'benchmarks.{command}' if command in _PACKAGES else f'benchmarks.commands.{command}'


def listing() -> str:
    """Return all names, a line each."""
    cases = [f'  {case.name:<20} {case.title}' for case in CASES.values()]
    commands = [f'  {name:<20} {title}' for name, title in COMMANDS.items()]
    return '\n'.join(('cases, with the options of `bench`:', *cases, '',
                      'commands, each with --help:', *commands))


def main(argv: Sequence[str]) -> int:
    """Run a command, or measure cases."""
    if not argv:
        print(listing())
        return 0
    name, *arguments = argv
    if name not in COMMANDS:
        sys.argv[0] = 'bench'
        return program.main()
    sys.argv[:] = [name, *arguments]
    runpy.run_module(module_of(name), run_name='__main__', alter_sys=True)
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
