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

"""What the program `plan` does with its command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from collections.abc import Sequence
import json
import os
from pathlib import Path

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.output_files import check_output
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import warn
from rt_robot_os.linux.paths import runtime_folder
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import to_json
from rt_robot_os.settings.load import load_from_arguments
from rt_robot_os.tools.plan.json_report import document
from rt_robot_os.tools.plan.measure import CoreRunner
from rt_robot_os.tools.plan.measure import measure
from rt_robot_os.tools.plan.measured import Measured
from rt_robot_os.tools.plan.measured import read_measured
from rt_robot_os.tools.plan.options import given
from rt_robot_os.tools.plan.options import parse
from rt_robot_os.tools.plan.report import make_report
from rt_robot_os.tools.plan.robot import robot_tasks
from rt_robot_os.tools.plan.text_report import report_lines

# Makes what runs a core, from its settings as JSON and the path of its socket.
MakeCore = Callable[[str, Path], CoreRunner]


def run(argv: Sequence[str], make_core: MakeCore) -> int:
    """
    Read the configuration, measure if asked to, analyse, write the report.

    :param argv: without the program's name.
    :return: the exit code, see :mod:`rt_robot_os.tools.plan.options`.
    """
    arguments = parse(argv)
    problems: list[str] = []
    settings, measured = None, None
    try:
        check_output('--save-measured', arguments.save_measured)
        settings, _ = load_from_arguments(argv, files=arguments.files)
    except ConfigError as error:
        problems += error.problems
    try:
        if arguments.measured is not None:
            measured = read_measured(arguments.measured)
    except ConfigError as error:
        problems += error.problems
    if settings is None or problems:
        return _refuse(problems)
    try:
        options = given(arguments)
        robot_tasks(settings, measured, options)  # before a measurement that takes minutes
        if arguments.measure is not None:
            measured = _measure(settings, make_core, arguments)
        report = make_report(robot_tasks(settings, measured, options), arguments.chain)
    except ConfigError as error:
        return _refuse(error.problems)
    except (RtRobotError, OSError) as error:
        warn('plan', error)
        return BAD_USE
    if arguments.json:
        print(json.dumps(document(report), indent=1))
    else:
        print('\n'.join(report_lines(report)))
    return report.exit_code


def _refuse(problems: Sequence[str]) -> int:
    count = len(problems)
    warn('plan', f'{count} problem{"s" if count > 1 else ""}, nothing was analysed:', problems)
    return BAD_USE


def _measure(settings: RobotSettings, make_core: MakeCore, arguments: argparse.Namespace
             ) -> Measured:
    # A socket of its own: the robot itself may be running.
    path = runtime_folder() / f'plan-{os.getpid()}.sock'
    measured = measure(settings, make_core(to_json(settings), path), path, arguments.measure,
                       lambda text: warn('plan', text))
    if arguments.save_measured is not None:
        measured.save(arguments.save_measured)
    return measured
