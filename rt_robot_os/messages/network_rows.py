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

"""The network graph as published: one row of numbers for each node."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from enum import IntEnum
from typing import Final
from typing import NamedTuple


class NodeState(IntEnum):
    """The state of a node; the worst that applies."""

    UNHEARD = 0  #: surveyed, without any packet
    GOOD = 1
    WEAK = 2  #: many of its packets are lost, or its battery is low
    SILENT = 3
    ASLEEP = 4  #: it was sent to sleep
    DOUBTFUL = 5  #: two nodes have its number, or it claims to be the sink, or is in a loop
    SINK = 6


class NodeRow(NamedTuple):
    """
    One node; NaN is not known.

    :ivar id: its number.
    :ivar x: position in the map, in m; so are y and z.
    :ivar stddev_m: of the position; 0 when it was surveyed.
    :ivar parent: the next node on the route to the sink; -1 when not known.
    :ivar hops: to the sink.
    :ivar cost: of the route to the sink, as the routing protocol counts it.
    :ivar state: a :class:`NodeState`.
    :ivar battery_v: voltage of its battery.
    :ivar days_left: until the battery is empty.
    :ivar delivery: share of its packets that arrived, since the first.
    :ivar recent: the same of the last minutes.
    :ivar received: packets, each counted once.
    :ivar lost: packets that did not arrive.
    :ivar duplicates: packets that arrived again.
    :ivar reboots: restarts of the node.
    :ivar age_s: since its last packet.
    """

    id: float  # noqa: A003
    x: float
    y: float
    z: float
    stddev_m: float
    parent: float
    hops: float
    cost: float
    state: float
    battery_v: float
    days_left: float
    delivery: float
    recent: float
    received: float
    lost: float
    duplicates: float
    reboots: float
    age_s: float


COLUMNS: Final = NodeRow._fields
WIDTH: Final = len(COLUMNS)


def rows_of(numbers: Sequence[float]) -> Iterator[NodeRow]:
    """Split numbers into rows; an incomplete row is skipped."""
    for start in range(0, len(numbers) - WIDTH + 1, WIDTH):
        yield NodeRow(*numbers[start:start + WIDTH])


def names_label(names: Mapping[int, str]) -> str:
    """Return the names of nodes as the label of the rows: ``1=hall 2=bed``."""
    return ' '.join(f'{number}={name}' for number, name in names.items())


def names_of(label: str) -> dict[int, str]:
    """Parse what :func:`names_label` returned; invalid parts are skipped."""
    found = {}
    for word in label.split():
        number, equals, name = word.partition('=')
        if equals and name and number.isascii() and number.isdigit():
            found[int(number)] = name
    return found
