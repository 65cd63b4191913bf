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
The one error tree.

::

    RtRobotError
    |- ConfigError (ValueError)      what the user wrote is wrong; holds every problem found
    |- LayoutError (ValueError)      a message type or its shape cannot be laid out
    |- TopicError (ValueError)       misuse of a topic: unknown name, too many subscribers, ...
    |- TaskError (ValueError)        misuse of the kernel: priority 0, a name taken, ...
    |- StartError (OSError)          this machine does not let it start; trying again is no use
    |- DeviceError (OSError)         the outside world: a port that is missing, unplugged, silent
    |- LinkError (OSError)           the other side of the link is gone or talks nonsense
    |- BlackBoxError (OSError)       a dump of the black box cannot be written or read
    |- RecordingError (OSError)      a recording cannot be written or read
    |- StoreError (OSError)          the database is away or full; nothing was kept, try again
    `- KernelError (RuntimeError)    a defect in the kernel itself: please report it

Every message names the object, the value and the remedy.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final


class RtRobotError(Exception):
    """Base of every error that this package raises on purpose."""


class ConfigError(RtRobotError, ValueError):
    """
    The configuration is wrong; raised once, before anything is opened.

    :ivar problems: one line a problem: file, key, value, remedy.
    """

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = tuple(problems)
        super().__init__('\n'.join(self.problems))


class LayoutError(RtRobotError, ValueError):
    """A message type or the shape asked of it cannot be laid out in fixed slots."""


class TopicError(RtRobotError, ValueError):
    """A topic was used against its declaration."""


class TaskError(RtRobotError, ValueError):
    """A task was declared or used in a way that the kernel cannot honour."""


class StartError(RtRobotError, OSError):
    """It cannot start here as things are: its name is taken, a folder or a limit forbids it."""


class DeviceError(RtRobotError, OSError):
    """A device cannot be reached or does not behave; it will be retried."""


class LinkError(RtRobotError, OSError):
    """The other side of the link is gone, refuses, or sent what is not the protocol."""


class BlackBoxError(RtRobotError, OSError):
    """A dump of the black box cannot be written, or is no whole dump of this version."""


class RecordingError(RtRobotError, OSError):
    """A recording cannot be written, or holds nothing that can be read."""


class StoreError(RtRobotError, OSError):
    """The database is away, full or locked: nothing of what was asked is done; try again."""


class KernelError(RtRobotError, RuntimeError):
    """A defect in the kernel; the message says what was found."""


# Of long lists the beginning is shown.
_NAMED_MAXIMUM: Final = 40


def no_match(option: str, value: str, there: Iterable[str]) -> ConfigError:
    """
    Make the error for a selection that matches nothing: doing nothing is no success.

    :param option: what the user selects with, such as ``--only``.
    :param there: what could have been selected.
    """
    names = list(there)
    more = len(names) - _NAMED_MAXIMUM
    listed = ', '.join(names[:_NAMED_MAXIMUM]) + (f' and {more} more' if more > 0 else '')
    return ConfigError([f'{option} {value!r} matches nothing; there are: {listed or "none"}'])
