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

"""All checks by group, and how one is asked so that nothing it does ends the doctor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rt_robot_os.tools.doctor.checks import clock
from rt_robot_os.tools.doctor.checks import cpu
from rt_robot_os.tools.doctor.checks import isolation
from rt_robot_os.tools.doctor.checks import kernel
from rt_robot_os.tools.doctor.checks import leftovers
from rt_robot_os.tools.doctor.checks import limits
from rt_robot_os.tools.doctor.checks import load
from rt_robot_os.tools.doctor.checks import memory
from rt_robot_os.tools.doctor.checks import place
from rt_robot_os.tools.doctor.checks import python
from rt_robot_os.tools.doctor.checks import robot
from rt_robot_os.tools.doctor.checks import ros
from rt_robot_os.tools.doctor.checks import serial
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import Line
from rt_robot_os.tools.doctor.finding import unknown
from rt_robot_os.tools.doctor.system import ProbeError
from rt_robot_os.tools.doctor.system import System


@dataclass(frozen=True)
class Group:
    """
    Checks that are shown together.

    :ivar key: the first part of the keys of its checks.
    """

    key: str
    title: str
    checks: Sequence[Check]


GROUPS = (
    Group('kernel', 'Linux', kernel.CHECKS),
    Group('limits', 'rights', limits.CHECKS),
    Group('place', 'machine', place.CHECKS),
    Group('cpu', 'CPU', cpu.CHECKS),
    Group('isolation', 'isolation', isolation.CHECKS),
    Group('clock', 'clocks', clock.CHECKS),
    Group('memory', 'memory and disk', memory.CHECKS),
    Group('load', 'load', load.CHECKS),
    Group('python', 'Python', python.CHECKS),
    Group('ros', 'ROS 2', ros.CHECKS),
    Group('serial', 'ports of devices', serial.CHECKS),
    Group('robot', 'the robot', robot.CHECKS),
    Group('leftovers', 'earlier runs', leftovers.CHECKS),
)


def ask(check: Check, system: System) -> list[Finding]:
    """Ask one check; one that raises becomes a line as well."""
    try:
        return list(check.ask(system))
    except ProbeError as error:
        return [unknown(str(error))]
    except OSError as error:
        return [unknown(_reason(error))]
    except Exception as error:  # whatever a machine holds, the other checks still count
        return [unknown(f'the check failed, please report it: {type(error).__name__}: {error}')]


def _reason(error: OSError) -> str:
    if error.filename is None:
        return error.strerror or str(error)
    if isinstance(error, FileNotFoundError):
        return f'{error.filename} is not there'
    if isinstance(error, PermissionError):
        return f'{error.filename} may not be read by this user'
    return f'{error.filename}: {error.strerror}'


def examine(group: Group, system: System) -> list[Line]:
    """Ask all checks of a group."""
    return [Line(group.key, check, finding) for check in group.checks
            for finding in ask(check, system)]
