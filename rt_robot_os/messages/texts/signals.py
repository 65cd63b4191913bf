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

"""Signals that are texts for people: the code of each goes beside it, as a signal of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.messages.texts.coded import coded

#: Names of such signals.
WORDED: Final = frozenset({'agent/state', 'planner/state', 'trajectory/state', 'stop_reason',
                           'steering'})
#: Before the name of the signal that has the code: a server that does not know it passes it on.
PREFIX: Final = 'codes/'


def codes_of_signals(signals: Mapping[str, Any]) -> dict[str, list[Any]]:
    """
    Return the codes of those signals that are texts and have none beside them, as signals.

    :param signals: the time and the value of each, by name; a value without a code gets null.
    """
    return {PREFIX + name: [pair[0], coded(pair[1])] for name, pair in signals.items()
            if name in WORDED and PREFIX + name not in signals
            and isinstance(pair, list) and len(pair) == 2 and isinstance(pair[1], str)}
