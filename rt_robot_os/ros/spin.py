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

"""Run the node `robot` until Ctrl-C or SIGTERM."""

from __future__ import annotations

import os
from pathlib import Path
import re
import signal
import sys
import tempfile
from types import FrameType

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.signals import SignalHandlerOptions

from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.errors import StartError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import OK
from rt_robot_os.core.dumps.folder import default_folder
from rt_robot_os.core.dumps.folder import expanded
from rt_robot_os.ros.announcements import frequent_announcements
from rt_robot_os.ros.console import Console
from rt_robot_os.ros.core_process import CoreProcess
from rt_robot_os.ros.node import RobotNode
from rt_robot_os.settings import RobotSettings


def logging_arguments() -> list[str]:
    """
    Check the folder of ROS 2's own log files, without which rclpy does not start.

    :return: arguments to add to the command line; problems are printed to standard error.
    """
    try:
        folder = default_folder()
        if not os.environ.get('ROS_LOG_DIR') and not os.environ.get('HOME'):
            os.environ['ROS_LOG_DIR'] = str(folder)  # rcl uses only $HOME
        # rcl also accepts ROS_LOG_DIR with a ~.
        _try(expanded(str(folder)))
    except (OSError, StartError) as error:
        reason = str(error) if isinstance(error, StartError) else (
            f'the log folder {folder} cannot be written: {error.strerror}')
        print(f'robot: {reason}; ROS 2 writes no log file. Set ROS_LOG_DIR to a writable folder',
              file=sys.stderr)
        return ['--ros-args', '--disable-external-lib-logs']
    return []


def _try(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        pass


# Signals are checked between two waits.
_WAIT_S = 0.1


class _StopOnSignal:
    """
    Record SIGINT and SIGTERM.

    rclpy's own handlers shut the context down immediately; here the core must end first, while
    its last reports can still be logged and published.
    """

    def __init__(self) -> None:
        self.signo = 0
        for signo in (signal.SIGINT, signal.SIGTERM):
            signal.signal(signo, self._note)

    def _note(self, signum: int, frame: FrameType | None) -> None:
        if self.signo:
            raise KeyboardInterrupt  # the second Ctrl-C: end immediately
        self.signo = signum


class _NotStarted(Exception):
    """ROS 2 refuses the node."""


def _make_node(settings: RobotSettings, core: CoreProcess | None, stop: _StopOnSignal,
               console: Console) -> RobotNode:
    try:
        return RobotNode(settings, console=console, stopping=lambda: bool(stop.signo), core=core)
    except RtRobotError:
        raise
    except Exception as error:
        raise _NotStarted(f'{type(error).__name__}: {error}') from error


def _refused(error: Exception) -> int:
    """Print in one line why ROS 2 refuses the start, without references to its source code."""
    text = ' '.join(str(error).split()) or type(error).__name__
    text = re.sub(r',? at (?:\./)?[\w./+-]+\.(?:c|cpp|hpp):\d+', '', text)
    print(f'robot: ROS 2 does not start: {text}', file=sys.stderr)
    return BAD_USE


def spin(settings: RobotSettings, core: CoreProcess | None = None) -> int:
    """
    Run the robot: configure, activate, spin, and clean up.

    :param core: that is loaded already; None starts one on demand.
    :return: the exit code.
    """
    stop = _StopOnSignal()
    console = Console()
    console.open()
    try:
        return _spin(settings, core, stop, console)
    finally:
        console.close()


def _spin(settings: RobotSettings, core: CoreProcess | None, stop: _StopOnSignal,
          console: Console) -> int:
    try:
        rclpy.init(args=[*sys.argv, *logging_arguments()],
                   signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # rclpy has many error classes for invalid arguments
        return _refused(error)
    node = None
    executor = SingleThreadedExecutor()
    code = FAILED
    try:
        with frequent_announcements():
            node = _make_node(settings, core, stop, console)
        code = _run(node, executor, stop)
    except KeyboardInterrupt:
        code = OK
    except _NotStarted as error:
        code = _refused(error)
    except RtRobotError as error:
        print(f'robot: {error}', file=sys.stderr)
        code = BAD_USE if isinstance(error, StartError) else FAILED
    finally:
        if node is not None:
            # The executor must not use the node while it is destroyed.
            executor.remove_node(node)
            executor.shutdown()
            node.destroy_node()
            if node.is_blocked:
                os._exit(code)  # the core has ended; a thread is blocked by the console
        rclpy.try_shutdown()
    return code


def _run(node: RobotNode, executor: SingleThreadedExecutor, stop: _StopOnSignal) -> int:
    if node.settings.autostart:
        configured = node.trigger_configure()
        if node.fatal:
            return BAD_USE
        if configured == TransitionCallbackReturn.SUCCESS and not stop.signo:
            node.trigger_activate()
    executor.add_node(node)
    while not stop.signo and not node.fatal:
        executor.spin_once(timeout_sec=_WAIT_S)
    return BAD_USE if node.fatal else OK
