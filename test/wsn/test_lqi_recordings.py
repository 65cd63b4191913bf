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

"""MultiHopLQI decides as TinyOS' own code did, in TOSSIM and as firmware on emulated motes."""

from __future__ import annotations

import csv
from pathlib import Path
import struct

from lqi_recordings import Firmware
from lqi_recordings import links
from lqi_recordings import on_air
from lqi_recordings import rows
import pytest

from rt_robot_os.features.wsn.cli.decisions import DecisionReplay
from rt_robot_os.features.wsn.routing.link_cost import link_cost

#: As firmware numbers the events that its root tells on the serial line.
DEBUG_EVENTS = {0x21: 'data_heard', 0x31: 'parent', 0x33: 'beacon_sent', 0x34: 'beacon_heard'}
DATA_AM_TYPE, DEBUG_AM_TYPE = 0x93, 0x75


def test_cost_by_lqi_as_its_users_published_it(data_dir: Path) -> None:
    with (data_dir / 'wsn/lqi_to_linkcost_netwg2007.csv').open() as file:
        table = {int(row['lqi']): int(row['cost']) for row in csv.DictReader(file)}
    assert len(table) == 19
    for u16_wrap in (True, False):
        assert {lqi: link_cost(lqi, u16_wrap) for lqi in table} == table


def test_every_decision_in_tossim(data_dir: Path) -> None:
    log = DecisionReplay()
    table = rows(data_dir / 'wsn/tossim_multihoplqi_decisions.csv.gz')
    unlike = [row for row in table if not log.explain(row)]
    assert unlike == []
    assert sum(log.explained.values()) == 3035
    # Most follow from the row before: it is not that a loss in between explains everything.
    assert sum(count for (_, lost), count in log.explained.items() if lost) < 300
    assert log.explained['Not a loop', True] == 0


@pytest.fixture(scope='module', params=['chain4', 'lossy4'])
def firmware(request: pytest.FixtureRequest, data_dir: Path) -> tuple[str, Firmware]:
    """Lead routers through what real firmware did."""
    name = request.param
    return name, Firmware(on_air(data_dir / f'wsn/mspsim_{name}_multihoplqi.air.csv.gz'),
                          links(data_dir / f'wsn/mspsim_{name}.links.txt'), nodes=4)


def test_every_frame_of_firmware(firmware: tuple[str, Firmware]) -> None:
    name, replay = firmware
    assert replay.unlike == []
    assert (name, replay.explained, replay.unseen) in {
        ('chain4', 694 + 76, 0), ('lossy4', 1930 + 112, 187)}


def test_what_the_root_of_firmware_told(firmware: tuple[str, Firmware], data_dir: Path) -> None:
    name, replay = firmware
    root = replay.nodes[0]
    told, serial = [], []
    for row in rows(data_dir / f'wsn/mspsim_{name}_multihoplqi.frames.csv.gz'):
        packet = bytes.fromhex(row['frame_hex_unescaped_with_crc'])[1:-2]
        am_type, payload = packet[7], packet[8:]
        if am_type == DEBUG_AM_TYPE:
            event = DEBUG_EVENTS[payload[0]]
            layout = '>HHH' if event == 'data_heard' else '>HBHx'
            told.append((event, *struct.unpack_from(layout, payload, 1)))
        elif am_type == DATA_AM_TYPE:
            serial.append(payload)
    ours = [note for note in root.notes if note[0] in DEBUG_EVENTS.values()]
    # In lossy4 the medium gave the root three packets that its radio lost.
    assert _missing(told, ours) == (3 if name == 'lossy4' else 0)
    assert _missing(serial, [packet.application for packet in root.delivered]) <= 3


def _missing(recorded: list[object], ours: list[object]) -> int:
    """Count what we have and the recording has not; all else must be the same, in order."""
    rest = iter(ours)
    skipped = 0
    for wanted in recorded:
        for one in rest:
            if one == wanted:
                break
            skipped += 1
        else:
            raise AssertionError(f'{wanted} was recorded, and we have it not')
    return skipped + len(list(rest))


def test_parents_and_costs_at_the_end_are_those_of_firmware(
        firmware: tuple[str, Firmware]) -> None:
    name, replay = firmware
    ends = {'chain4': [(0, 216, 1), (1, 432, 2), (2, 648, 3)],
            'lossy4': [(0, 1241, 1), (0, 1518, 1), (2, 2594, 2)]}
    assert [(router.parent, router.cost, router.hops)
            for router in replay.routers[1:]] == ends[name]
