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

"""Declarations of the topics that parts of the gateway read, and the samples they get."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple
from typing import Protocol

from rt_robot_os.link.client import TopicInfo


class Sample(NamedTuple):
    """
    One sample of a topic.

    :ivar stamp_ns: on CLOCK_MONOTONIC.
    :ivar seq: its number in the topic, since this core began.
    """

    topic: str
    type: str  # noqa: A003
    stamp_ns: int
    seq: int
    cdr: memoryview


@dataclass(frozen=True)
class Reads:
    """
    A topic that a part reads; one mirror serves all parts.

    :ivar topic: its name; ``*`` stands for one part of it.
    :ivar take: called by the link's thread with each sample, whose bytes are valid meanwhile.
    :ivar every: all samples, from the oldest stored in the core; otherwise the newest, at most
        ``rate_hz`` times a second.
    :ivar rate_hz: 0 means unlimited.
    :ivar shown: it is read for pages, at most at the rate they request.
    """

    topic: str
    take: Callable[[Sample], None]
    every: bool = False
    rate_hz: float = 0.0
    shown: bool = False


class TopicListener(Protocol):
    """A part of the gateway that reads and publishes topics of a robot."""

    def reads(self) -> Sequence[Reads]:
        """Return the topics that it reads."""

    def publishes(self) -> Sequence[str]:
        """Return the topics that it publishes."""

    def met_robot(self, topics: Mapping[str, TopicInfo]) -> None:
        """Handle a connection to a core with these topics."""
