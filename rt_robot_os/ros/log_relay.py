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


def log_to(logger: Any, severity: int, text: str) -> None:
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
    Return whether the user has set a level for a logger, for a parent, or for all.

    The default level of ROS is INFO.
    """
    if rclpy.logging.get_logger_level('') != rclpy.logging.LoggingSeverity.INFO:
        return True
    parts = name.split('.')
    return any(rclpy.logging.get_logger_level('.'.join(parts[:count]))
               != rclpy.logging.LoggingSeverity.UNSET for count in range(1, len(parts) + 1))


class LogRelay:
    """
    Log the reports of the core and the node, each line once.

    On /rosout the lines of the core have the name ``node.source`` and the time at which the core
    logged them. They are published here, because rclpy would stamp them with their time of
    arrival. No caller waits for the console or the disk.

    :param robot: name of the file.
    :param console: counts the lines that were not read.
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
        self._writer = ConsoleWriter(self._write, lambda count: ConsoleLine(
            int(Severity.WARN), 0, '', f'{count} lines of the log are not shown here: they came '
            'faster than they could be written'))
        if settings.file:
            folder: Path = expanded(settings.folder) if settings.folder else default_folder()
            self.file = LogFile(folder / f'{robot}.log', round(settings.file_mb * _BYTES_PER_MB),
                                settings.files, self._warn)

    def relay(self, severity: int, at_ns: int, source: str, text: str) -> None:
        """Log a line of the core; never blocks; from one thread only."""
        self.lines += 1
        self._log(nearest_severity(severity), at_ns + self._mapper.offset_ns,
                  safe_line(source), safe_text(text))

    def note(self, severity: int, text: str) -> None:
        """Log a line of the node itself; never blocks, thread-safe."""
        self._log(nearest_severity(severity), 0, '', safe_text(text))

    def _log(self, severity: Severity, wall_ns: int, source: str, text: str) -> None:
        if self.file is not None:
            self.file.write(line_of(wall_ns or time.time_ns(), severity.name, source or 'node',
                                    text))
        self._writer.put(ConsoleLine(int(severity), wall_ns, source, text))

    def _write(self, line: ConsoleLine) -> None:
        """Write a line; the thread may be blocked by the console."""
        if not line.source:
            log_to(self._own, line.severity, line.text)
            return
        logger = self._loggers.get(line.source) or self._logger(line.source)
        if not logger.is_enabled_for(rclpy.logging.LoggingSeverity(line.severity)):
            return
        with suppress(Exception):  # rclpy was shut down, or the time does not fit a message
            self._publisher.publish(
                log_message(line.wall_ns, line.severity, logger.name, line.text))
        log_to(logger, line.severity, line.text)

    def _logger(self, source: str) -> Any:
        # Only a child of the node's logger is on /rosout.
        logger = rclpy.logging.get_logger(logger_name(self._name, source))
        if not level_is_chosen(logger.name):
            # The core has already filtered by log_level.
            logger.set_level(rclpy.logging.LoggingSeverity.DEBUG)
        if len(self._loggers) >= _LOGGERS_MAXIMUM:
            self._loggers.clear()
        self._loggers[source] = logger
        return logger

    def _warn(self, text: str) -> None:
        self._writer.put(ConsoleLine(int(Severity.WARN), 0, '', text))

    def statistics(self) -> dict[str, int | str]:
        """Return the numbers of lines, in total, in the file, and missing in file and console."""
        file = self.file
        return {'lines': self.lines, 'file': str(file.path) if file else 'off',
                'written': file.written if file else 0, 'lost': file.lost if file else 0,
                'untold': self._writer.untold,
                'unread': self._console.dropped if self._console is not None else 0}

    def close(self) -> bool:
        """
        Write queued lines; may be called twice.

        :return: False if a thread is still blocked by the console.
        """
        if self.file is not None:
            self.file.close()
        return self._writer.close()
