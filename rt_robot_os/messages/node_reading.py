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

"""The state of a sensor node as a JSON object: one row of the network graph, for a server."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import math
from typing import Annotated
from typing import Any
from typing import Final

from rt_robot_os.messages.codec import Codec
from rt_robot_os.messages.fields import Choice
from rt_robot_os.messages.fields import Real
from rt_robot_os.messages.fields import Text
from rt_robot_os.messages.fields import Whole
from rt_robot_os.messages.network_rows import NodeRow
from rt_robot_os.messages.network_rows import NodeState

NODE_STATES: Final = {each.name.lower(): each for each in NodeState}
_DIGITS: Final = 4
_ID: Final = Whole(-(1 << 53), 1 << 53)
_METRES: Final = Real(unit='m')
_SHARE: Final = Real(0.0, 1.0)


@dataclass(frozen=True, slots=True)
class NodeReading:
    """
    What is known of a sensor node; null is not known.

    :ivar name: from the survey, else ``node`` and its number.
    :ivar id: its number.
    :ivar x: position in the map.
    :ivar y: as x.
    :ivar z: as x.
    :ivar stddev_m: of the position; 0 when it was surveyed.
    :ivar parent: the next node on the route to the sink; -1 when not known.
    :ivar hops: to the sink.
    :ivar cost: of the route to the sink, as the routing protocol counts it.
    :ivar state: the worst that applies.
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

    name: Annotated[str, Text(200, 1)]
    id: Annotated[int | None, _ID] = None  # noqa: A003
    x: Annotated[float | None, _METRES] = None
    y: Annotated[float | None, _METRES] = None
    z: Annotated[float | None, _METRES] = None
    stddev_m: Annotated[float | None, _METRES] = None
    parent: Annotated[int | None, _ID] = None
    hops: Annotated[int | None, _ID] = None
    cost: Annotated[float | None, Real()] = None
    state: Annotated[NodeState | None, Choice(NODE_STATES)] = None
    battery_v: Annotated[float | None, Real(unit='V')] = None
    days_left: Annotated[float | None, Real(unit='d')] = None
    delivery: Annotated[float | None, _SHARE] = None
    recent: Annotated[float | None, _SHARE] = None
    received: Annotated[int | None, _ID] = None
    lost: Annotated[int | None, _ID] = None
    duplicates: Annotated[int | None, _ID] = None
    reboots: Annotated[int | None, _ID] = None
    age_s: Annotated[float | None, Real(unit='s')] = None

    @classmethod
    def of_row(cls, name: str, row: NodeRow) -> NodeReading:
        """Make it of a row; NaN becomes None."""
        known = 0 <= row.state < len(NodeState)  # a NaN is not
        values: dict[str, Any] = {
            key: None if not math.isfinite(value) else
            int(value) if key in _INTEGERS else round(value, _DIGITS)
            for key, value in zip(NodeRow._fields, row)}
        return cls(name, **{**values, 'state': NodeState(int(row.state)) if known else None})

    def to_dict(self) -> dict[str, Any]:
        """Return it as a JSON object."""
        found = {each.name: getattr(self, each.name) for each in CODEC.fields}
        found['state'] = None if self.state is None else self.state.name.lower()
        return found

    def to_record(self) -> dict[str, Any]:
        """Return the content of a record of type ``node``."""
        found = self.to_dict()
        return {'node': self.name, **{key: found[key] for key in _RECORD_KEYS}}

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> NodeReading:
        """
        Read what :meth:`to_dict` gave; unknown keys are ignored.

        :raises ValueError: with the field, its value and what it must be.
        """
        return CODEC.read(found)


_RECORD_KEYS: Final = ('state', 'battery_v', 'days_left', 'delivery', 'recent', 'received',
                       'lost', 'parent', 'hops', 'age_s')
CODEC: Final = Codec(NodeReading)
_INTEGERS: Final = frozenset(
    each.key for each in CODEC.fields if isinstance(each.limit, Whole))
