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
The actuator: a device that moves something only while it receives commands.

A command is active from when it is received until it is ``command_timeout_s`` old. Then, and
whenever the device is opened, closed, held or goes to FAULT, it is brought to its safe state, and
only a command that is published afterwards moves it again. After a gap, in which the core or the
machine was suspended, only a command whose stamp is later than the gap moves it.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.base.errors import TopicError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.device import Device
from rt_robot_os.devices.device import Value
from rt_robot_os.topics.ports import Input

TIMEOUT: Final = 'command_timeout_s'


class Actuator(Device):
    """
    A device that moves something.

    A driver derives from it before the base class of its port, declares the command and executes
    it::

        class Wheels(Actuator, SerialDevice[Reply]):
            command = Input('cmd_vel_safe', wake=True, message='geometry_msgs/msg/Twist')

            def actuate(self, now_ns):
                self.send(speed_order(self.command.msg))

            def safe_state(self):
                self.send(STOP)

    :cvar command: the input. The newest command is used; with ``wake`` it is executed immediately,
        otherwise with the next poll.
    :cvar COMMAND_TIMEOUT_S: default of the setting ``command_timeout_s``.
    """

    command: ClassVar[Input]
    COMMAND_TIMEOUT_S: ClassVar[float] = 0.3

    def __init__(self, name: str, settings: Mapping[str, Any], *rest: Any) -> None:
        """
        Store the settings; nothing is opened.

        :param rest: further arguments of the base class of the port, such as a decoder.
        :raises TopicError: the class declares no input ``command``.
        """
        super().__init__(name, settings, *rest)
        if not isinstance(self.ports().get('command'), Input):
            raise TopicError(f'{name}: {type(self).__name__} has no command: an actuator declares '
                             "command = Input('cmd_vel', ...)")
        self._deadline_ns = self._awake_ns = 0
        self._commands = self._late = self._timeouts = self._rests = 0

    @abstractmethod
    def actuate(self, now_ns: int) -> None:
        """
        Execute ``self.command.msg``, without blocking.

        Called with each new command, and with each poll while the last one is active.

        :raises DeviceError: the device is gone.
        """

    @abstractmethod
    def safe_state(self) -> None:
        """
        Bring what the device moves to rest, without blocking; the port is open.

        It may be called at any time, the first time right after :meth:`open`, and more than once.

        :raises DeviceError: the device is gone.
        """

    @classmethod
    def fields(cls) -> tuple[Field, ...]:
        """Return all settings: those of every device, and ``command_timeout_s``."""
        return (*super().fields(), Field(
            TIMEOUT, float, cls.COMMAND_TIMEOUT_S, 'Age of a command at which the device is '
            'brought to rest.', 's', 0.01, 60.0, live=True))

    @property
    def is_commanded(self) -> bool:
        """Return whether a command is active."""
        return self._deadline_ns != 0

    def is_moving(self) -> bool:
        """
        Return whether the active command moves anything.

        After a command to stop, missing commands cause no warning. The default is that every
        command moves something.
        """
        return True

    def own_rounds_hz(self) -> float:
        """Return how often the age of an active command is checked."""
        return 1.0 / float(self.settings[TIMEOUT])

    def receive(self, now_ns: int, polled: bool) -> int:
        """
        Execute the newest command, or rest when the active one is too old.

        Its age counts from its stamp, or from now if the stamp is in the future.

        :return: the time at which the active command becomes too old; 0 when there is none.
        """
        command = self.command
        is_new = command.latest()
        if is_new:
            self._commands += 1
            deadline_ns = min(command.stamp_ns, now_ns) + self._timeout_ns()
            if command.stamp_ns < self._awake_ns:
                deadline_ns = 0
            if deadline_ns > now_ns:
                self._deadline_ns = deadline_ns
            else:
                self._late += 1
        if self._deadline_ns:
            if now_ns >= self._deadline_ns or (is_new and deadline_ns <= now_ns):
                self._timeouts += 1
                if self.is_moving():
                    self.log.warn('no command for %g s: brought to rest', self.settings[TIMEOUT],
                                  throttle_s=1.0)
                self.rest()
            elif is_new or polled:
                self.actuate(now_ns)
        return self._deadline_ns

    def wake_up(self, now_ns: int) -> None:
        """Accept only commands that are stamped from now on."""
        self._awake_ns = now_ns

    def rest(self) -> None:
        """
        Go to the safe state; commands published until now move nothing any more.

        :raises DeviceError: the device is gone.
        """
        self._deadline_ns = 0
        self._rests += 1
        while self.command.skip(newest=True):
            pass
        self.safe_state()

    def input_counters(self) -> Mapping[str, Value]:
        """
        Return the counters of the commands.

        ``commands``: received. ``late_commands``: of these, too old on arrival or stamped before a
        gap. ``command_timeouts``: times that the last one became too old. ``rests``: times that
        the device was brought to rest, for any reason. ``command``: whether one is active.
        """
        return {'command': 'in force' if self._deadline_ns else 'none',
                'commands': self._commands, 'late_commands': self._late,
                'command_timeouts': self._timeouts, 'rests': self._rests}

    def _timeout_ns(self) -> int:
        return round(float(self.settings[TIMEOUT]) * NS_PER_S)
