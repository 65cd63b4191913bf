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
The received record numbers of a robot's start: one bit each, in blocks.

A received number stays known for ever: after retention or erasure deleted the row, the same record
is still recognised as a duplicate. A full block is a row without bits. The full blocks at the
beginning are only counted, so that a complete sequence takes no space.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Final
from typing import TypeVar

from rt_robot_os.monitor.store.tables import BOOTS
from rt_robot_os.monitor.store.tables import RECEIVED
from sqlalchemy import bindparam
from sqlalchemy import Connection
from sqlalchemy import delete
from sqlalchemy import insert
from sqlalchemy import select
from sqlalchemy import tuple_
from sqlalchemy import update

#: Numbers in a block.
BLOCK: Final = 2048
_BYTES: Final = BLOCK // 8
_FULL: Final = b'\xff' * _BYTES
_PART: Final = 500
_T = TypeVar('_T')


class ReceivedNumbers:
    """The numbers that one transaction reads and adds; :meth:`save` writes them."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._complete: dict[int, int] = {}
        self._blocks: dict[tuple[int, int], bytearray] = {}
        self._there: set[tuple[int, int]] = set()
        self._changed: set[tuple[int, int]] = set()

    def load(self, numbers: Mapping[int, Iterable[int]]) -> None:
        """Read the blocks of these numbers, by start, in few queries."""
        fresh = [boot for boot in numbers if boot not in self._complete]
        for part in _parts(fresh):
            for boot, blocks in self._connection.execute(
                    select(BOOTS.c.id, BOOTS.c.blocks).where(BOOTS.c.id.in_(part))):
                self._complete[boot] = blocks
        wanted = [key for boot, seqs in numbers.items()
                  for key in sorted({(boot, seq // BLOCK) for seq in seqs})
                  if key[1] >= self._complete[boot] and key not in self._blocks]
        for keys in _parts(wanted):
            for boot, block, bits in self._connection.execute(select(RECEIVED).where(
                    tuple_(RECEIVED.c.boot_id, RECEIVED.c.block).in_(keys))):
                self._blocks[boot, block] = bytearray(bits or _FULL)
                self._there.add((boot, block))
            for key in keys:
                self._blocks.setdefault(key, bytearray(_BYTES))

    def is_new(self, boot: int, seq: int) -> bool:
        """Return whether a number was not received before; its block must be loaded."""
        block = seq // BLOCK
        return block >= self._complete[boot] and not (
            self._blocks[boot, block][seq % BLOCK // 8] & 1 << seq % 8)

    def take(self, boot: int, seq: int) -> None:
        """Add a new number."""
        block = seq // BLOCK
        self._blocks[boot, block][seq % BLOCK // 8] |= 1 << seq % 8
        self._changed.add((boot, block))

    def save(self) -> None:
        """Write the changed blocks."""
        for boot in sorted({boot for boot, _ in self._changed}):
            self._shorten(boot)
        rows = {key: b'' if self._blocks[key] == _FULL else bytes(self._blocks[key])
                for key in sorted(self._changed)}
        fresh = [{'boot_id': key[0], 'block': key[1], 'bits': bits}
                 for key, bits in rows.items() if key not in self._there]
        known = [{'a_boot': key[0], 'a_block': key[1], 'bits': bits}
                 for key, bits in rows.items() if key in self._there]
        if fresh:
            self._connection.execute(insert(RECEIVED), fresh)
        if known:
            self._connection.execute(update(RECEIVED).where(
                RECEIVED.c.boot_id == bindparam('a_boot'),
                RECEIVED.c.block == bindparam('a_block')), known)

    def _shorten(self, boot: int) -> None:
        """Replace full blocks at the beginning by their count."""
        first = last = self._complete[boot]
        if (boot, first) not in self._changed or self._blocks[boot, first] != _FULL:
            return
        while self._is_full(boot, last):
            self._changed.discard((boot, last))
            last += 1
        self._connection.execute(delete(RECEIVED).where(
            RECEIVED.c.boot_id == boot, RECEIVED.c.block >= first, RECEIVED.c.block < last))
        self._connection.execute(update(BOOTS).where(BOOTS.c.id == boot), {'blocks': last})

    def _is_full(self, boot: int, block: int) -> bool:
        if (boot, block) in self._blocks:
            return self._blocks[boot, block] == _FULL
        return self._connection.execute(select(RECEIVED.c.bits).where(
            RECEIVED.c.boot_id == boot, RECEIVED.c.block == block)).scalar() == b''


def _parts(found: Sequence[_T]) -> Iterator[Sequence[_T]]:
    for begin in range(0, len(found), _PART):
        yield found[begin:begin + _PART]
