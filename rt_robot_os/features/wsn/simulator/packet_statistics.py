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


"""The truth of a simulation: which packets were made, which came, when, and what was lost."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
from typing import Final
from typing import NamedTuple

# Of each origin so many packets are looked for; older ones can only be duplicates.
_WINDOW: Final = 512


class Gap(NamedTuple):
    """
    A time in which nothing of one origin came.

    :ivar begin_ns: when the first packet was made that was lost.
    :ivar end_ns: when the first was made that came again; the end of the simulation if none did.
    :ivar lost: how many were lost.
    """

    origin: int
    begin_ns: int
    end_ns: int
    lost: int


class _Origin:
    """The packets of one node, in the order in which it made them."""

    __slots__ = ('made_ns', 'took_ns', 'came', 'numbers')

    def __init__(self) -> None:
        self.made_ns = array('q')
        self.took_ns = array('q')
        self.came = bytearray()
        self.numbers: dict[bytes, int] = {}


class PacketStatistics:
    """
    Counts by truth, not by what packets say of themselves.

    :param ids: of the nodes that make packets.
    :ivar duplicates: packets that came to the sink once more.
    :ivar unknown: what came and was never made, or so long ago that it is not known any more.
    :ivar latencies_ns: of each packet that came, in the order of coming.
    """

    def __init__(self, ids: Iterable[int]) -> None:
        self._origins = {each: _Origin() for each in ids}
        self.duplicates = 0
        self.unknown = 0
        self.latencies_ns = array('q')

    def add_generated(self, origin: int, application: bytes, now_ns: int) -> None:
        """Note a packet; its bytes must differ from those of the last ones of its origin."""
        one = self._origins[origin]
        numbers = one.numbers
        numbers.pop(application, None)  # a node that has booted begins to count anew
        if len(numbers) >= _WINDOW:
            del numbers[next(iter(numbers))]
        numbers[application] = len(one.made_ns)
        one.made_ns.append(now_ns)
        one.took_ns.append(-1)
        one.came.append(0)

    def add_delivered(self, origin: int, application: bytes, now_ns: int) -> bool:
        """
        Note what the sink got.

        :return: whether it came for the first time.
        """
        one = self._origins.get(origin)
        number = None if one is None else one.numbers.get(application)
        if one is None or number is None:
            self.unknown += 1
            return False
        if one.came[number]:
            self.duplicates += 1
            return False
        one.came[number] = 1
        one.took_ns[number] = took_ns = now_ns - one.made_ns[number]
        self.latencies_ns.append(took_ns)
        return True

    @property
    def generated(self) -> Mapping[int, int]:
        """Count what each node made."""
        return {each: len(one.made_ns) for each, one in self._origins.items()}

    @property
    def delivered(self) -> Mapping[int, int]:
        """Count what came of each node, each packet once."""
        return {each: one.came.count(1) for each, one in self._origins.items()}

    def lost_before_last(self, origin: int) -> int:
        """Count what one node lost before the last packet of it that came."""
        came = self._origins[origin].came
        return came.rfind(1) + 1 - came.count(1)

    def fates(self) -> Iterator[tuple[int, int, int]]:
        """Return origin, time of making and how long it took, -1 if it is lost, of each packet."""
        for each, one in self._origins.items():
            for made_ns, took_ns in zip(one.made_ns, one.took_ns):
                yield each, made_ns, took_ns

    def gaps(self, least: int, end_ns: int) -> list[Gap]:
        """
        Find where several packets in a row were lost.

        :param least: so many.
        :param end_ns: of the simulation.
        """
        found = []
        for each, one in self._origins.items():
            lost = one.came.find(0)
            while lost >= 0:
                after = one.came.find(1, lost)
                end = len(one.came) if after < 0 else after
                if end - lost >= least:
                    found.append(Gap(each, one.made_ns[lost],
                                     end_ns if after < 0 else one.made_ns[after], end - lost))
                lost = -1 if after < 0 else one.came.find(0, after)
        return sorted(found, key=lambda gap: gap.begin_ns)
