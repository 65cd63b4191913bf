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
Commands as strings and their answers, on two topics of the core.

A command is a ``std_msgs/msg/String``; so is the answer, which holds a
:class:`rt_robot_os.messages.command_answer.CommandAnswer`. A client finds its own answer by the
command.
"""

from __future__ import annotations

from rt_robot_os.messages.cdr import string_in
from rt_robot_os.messages.command_answer import CommandAnswer


def answer_of(cdr: bytes | memoryview) -> CommandAnswer:
    """
    Parse an answer.

    :raises ValueError: it is not an answer.
    """
    return CommandAnswer.from_json(string_in(cdr))
