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
The exception hierarchy.

::

    RtRobotError
    |- ConfigError (ValueError)      invalid configuration; lists every problem found
    |- LayoutError (ValueError)      a message type or its shape is not supported
    |- TopicError (ValueError)       misuse of a topic: unknown name, too many subscribers, ...
    |- TaskError (ValueError)        misuse of the kernel: priority 0, duplicate name, ...
    |- StartError (OSError)          the machine does not allow the start; retrying is useless
    |- DeviceError (OSError)         a port is missing or unplugged, or a device does not respond
    |- LinkError (OSError)           the other side of the link is gone or violates the protocol
    |- BlackBoxError (OSError)       a dump of the black box cannot be written or read
    |- RecordingError (OSError)      a recording cannot be written or read
    |- StoreError (OSError)          the database is unreachable or full; nothing was stored, retry
    `- KernelError (RuntimeError)    a defect in the kernel itself: please report it

Every message names the object, the value and the remedy.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final


class RtRobotError(Exception):
    """Base of every exception that this package raises intentionally."""


class ConfigError(RtRobotError, ValueError):
    """
    The configuration is wrong; raised once, before anything is opened.

    :ivar problems: one line per problem: file, key, value, remedy.
    """

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = tuple(problems)
        super().__init__('\n'.join(self.problems))


class LayoutError(RtRobotError, ValueError):
    """A message type with the given shape does not fit fixed slots."""


class TopicError(RtRobotError, ValueError):
    """A topic was used in conflict with its declaration."""


class TaskError(RtRobotError, ValueError):
    """A task was declared or used in a way that the kernel does not support."""


class StartError(RtRobotError, OSError):
    """A program cannot start: its name is in use, or a folder or a limit does not allow it."""


class DeviceError(RtRobotError, OSError):
    """A device is unreachable or faulty; it will be retried."""


class LinkError(RtRobotError, OSError):
    """The other side of the link is gone, rejects a request, or violates the protocol."""


class BlackBoxError(RtRobotError, OSError):
    """A dump of the black box cannot be written, or is incomplete or of another version."""


class RecordingError(RtRobotError, OSError):
    """A recording cannot be written, or has no readable content."""


class StoreError(RtRobotError, OSError):
    """The database is unreachable, full or locked: the request had no effect; try again."""


class KernelError(RtRobotError, RuntimeError):
    """A defect in the kernel; the message describes it."""


# Only the first items of a long list are shown.
_NAMED_MAXIMUM: Final = 40


def no_match(option: str, value: str, there: Iterable[str]) -> ConfigError:
    """
    Make the error for a selection that matches nothing.

    :param option: the option of the selection, such as ``--only``.
    :param there: the valid names.
    """
    names = list(there)
    more = len(names) - _NAMED_MAXIMUM
    listed = ', '.join(names[:_NAMED_MAXIMUM]) + (f' and {more} more' if more > 0 else '')
    return ConfigError([f'{option} {value!r} matches nothing; there are: {listed or "none"}'])
