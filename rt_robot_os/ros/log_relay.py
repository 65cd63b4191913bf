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


"""Log the reports of the core in ROS: on the console, on /rosout, and in the log file."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
import time
from typing import Any

from rcl_interfaces.msg import Log
import rclpy.logging
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy
from rclpy.qos import QoSProfile
from rclpy.qos import ReliabilityPolicy

from rt_robot_os.base.reports import Severity
from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.base.safe_text import safe_text
from rt_robot_os.core.dumps.folder import default_folder
from rt_robot_os.core.dumps.folder import expanded
from rt_robot_os.link.log_message import DEPTH
from rt_robot_os.link.log_message import log_message
from rt_robot_os.link.log_message import logger_name
from rt_robot_os.link.log_message import nearest_severity
from rt_robot_os.link.log_message import TOPIC
from rt_robot_os.link.stamp_mapper import StampMapper
from rt_robot_os.ros.console import Console
from rt_robot_os.ros.console_writer import ConsoleLine
from rt_robot_os.ros.console_writer import ConsoleWriter
from rt_robot_os.ros.log_file import line_of
from rt_robot_os.ros.log_file import LogFile
from rt_robot_os.settings import LogSettings

_BYTES_PER_MB = 1_000_000
_LOGGERS_MAXIMUM = 1000


def say(logger: Any, severity: int, text: str) -> None:
    """Log with rclpy, which allows one severity for each line of code that logs."""
    if severity >= Severity.FATAL:
        logger.fatal(text)
    elif severity >= Severity.ERROR:
        logger.error(text)
    elif severity >= Severity.WARN:
        logger.warning(text)
    elif severity >= Severity.INFO:
        logger.info(text)
    else:
        logger.debug(text)


def level_is_chosen(name: str) -> bool:
    """
    Look whether the user has set a level for a logger, for one above it, or for all.

    A default level of INFO is what ROS has when nobody says anything.
    """
    if rclpy.logging.get_logger_level('') != rclpy.logging.LoggingSeverity.INFO:
        return True
    parts = name.split('.')
    return any(rclpy.logging.get_logger_level('.'.join(parts[:count]))
               != rclpy.logging.LoggingSeverity.UNSET for count in range(1, len(parts) + 1))


class LogRelay:
    """
    Log what the core and the node report, each line once.

    On /rosout the lines of the core have the name ``node.source`` and the moment at which they
    were logged there. They are published here: rclpy would stamp them with the moment of their
    arrival. No caller waits for the console or the disk.

    :param robot: gives the file its name.
    :param console: what counts the lines that nobody reads.
    """

    def __init__(self, node: Node, mapper: StampMapper, settings: LogSettings, robot: str,
                 console: Console | None = None) -> None:
        self._console = console
        self.lines = 0
        self._name = node.get_logger().name
        self._own = node.get_logger()
        self._mapper = mapper
        self._loggers: dict[str, Any] = {}
        self._publisher = node.create_publisher(Log, TOPIC, QoSProfile(
            depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL))
        self.file: LogFile | None = None
        self._writer = ConsoleWriter(self._tell, lambda count: ConsoleLine(
            int(Severity.WARN), 0, '', f'{count} lines of the log are not shown here: they came '
            'faster than they could be told'))
        if settings.file:
            folder: Path = expanded(settings.folder) if settings.folder else default_folder()
            self.file = LogFile(folder / f'{robot}.log', round(settings.file_mb * _BYTES_PER_MB),
                                settings.files, self._complain)

    def relay(self, severity: int, at_ns: int, source: str, text: str) -> None:
        """Log one line of the core; never waits; from one thread only."""
        self.lines += 1
        self._hand_on(nearest_severity(severity), at_ns + self._mapper.offset_ns,
                      safe_line(source), safe_text(text))

    def note(self, severity: int, text: str) -> None:
        """Log a line of the node itself; never waits, from any thread."""
        self._hand_on(nearest_severity(severity), 0, '', safe_text(text))

    def _hand_on(self, severity: Severity, wall_ns: int, source: str, text: str) -> None:
        if self.file is not None:
            self.file.write(line_of(wall_ns or time.time_ns(), severity.name, source or 'node',
                                    text))
        self._writer.put(ConsoleLine(int(severity), wall_ns, source, text))

    def _tell(self, line: ConsoleLine) -> None:
        """Write one line; the thread that does so may wait for the console."""
        if not line.source:
            say(self._own, line.severity, line.text)
            return
        logger = self._loggers.get(line.source) or self._logger(line.source)
        if not logger.is_enabled_for(rclpy.logging.LoggingSeverity(line.severity)):
            return
        with suppress(Exception):  # rclpy was shut down, or the clock is no time of a message
            self._publisher.publish(
                log_message(line.wall_ns, line.severity, logger.name, line.text))
        say(logger, line.severity, line.text)

    def _logger(self, source: str) -> Any:
        # A logger that is no child of the node's is not on /rosout.
        logger = rclpy.logging.get_logger(logger_name(self._name, source))
        if not level_is_chosen(logger.name):
            # The core has filtered by each log_level already.
            logger.set_level(rclpy.logging.LoggingSeverity.DEBUG)
        if len(self._loggers) >= _LOGGERS_MAXIMUM:
            self._loggers.clear()
        self._loggers[source] = logger
        return logger

    def _complain(self, text: str) -> None:
        self._writer.put(ConsoleLine(int(Severity.WARN), 0, '', text))

    def statistics(self) -> dict[str, int | str]:
        """Count the lines, those in the file, and those missing in the file and on the console."""
        file = self.file
        return {'lines': self.lines, 'file': str(file.path) if file else 'off',
                'written': file.written if file else 0, 'lost': file.lost if file else 0,
                'untold': self._writer.untold,
                'unread': self._console.dropped if self._console is not None else 0}

    def close(self) -> bool:
        """
        Write what waits; may be called twice.

        :return: False when a thread still waits for a console that nobody reads.
        """
        if self.file is not None:
            self.file.close()
        return self._writer.close()
