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

"""The Collection Tree Protocol: at which cost a node changes its parent, tells it, or waits."""

from __future__ import annotations

from ctp_mote import ME
from ctp_mote import Mote
import pytest
from rt_robot_os.features.wsn.packets.ctp import CONGESTED
from rt_robot_os.features.wsn.packets.ctp import CtpBeacon
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.routing.ctp_rules import CtpRules
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Received

#: A perfect link costs 10 tenths of a transmission.
LINK = 10
UPDATE_MS = 8192


def settled(etx: int) -> Mote:
    """Return a node over neighbour 1, which says that cost; it beacons seldom by now."""
    mote = Mote()
    mote.beacon(1, etx, 3)
    mote.think()
    assert mote.ctp.parent == 1
    # At an update, so that the next one is a whole period away.
    mote.node.run_binary_ms(UPDATE_MS * 200)
    mote.told()
    return mote


@pytest.mark.parametrize(('gain', 'told'), [(16, 0), (20, 0), (21, 1), (30, 1)])
def test_only_a_gain_of_more_than_two_transmissions_is_told_at_once(gain: int, told: int) -> None:
    mote = settled(30)
    mote.beacon(2, 30 - gain, 3)
    mote.node.run_binary_ms(UPDATE_MS - 1)
    assert mote.ctp.parent == 1 and not mote.told()
    mote.node.run_binary_ms(1)
    assert mote.ctp.parent == 2
    mote.node.run_binary_ms(128)
    assert [one.etx for one in mote.told()] == [30 - gain + LINK] * told


@pytest.mark.parametrize(('gain', 'parent'), [(15, 1), (16, 2)])
def test_a_gain_of_one_and_a_half_transmissions_is_no_reason_to_change(
        gain: int, parent: int) -> None:
    mote = settled(30)
    mote.beacon(2, 30 - gain, 3)
    mote.node.run_binary_ms(UPDATE_MS)
    assert mote.ctp.parent == parent


@pytest.mark.parametrize(('etx', 'parent'), [(9, 2), (10, 1), (24, 1), (99, 1)])
def test_a_congested_parent_is_left_for_who_is_as_near_to_the_sink_and_not_for_a_child(
        etx: int, parent: int) -> None:
    mote = Mote(rules=CtpRules(congestion=True))
    mote.beacon(1, 10, 3)
    mote.think()
    mote.beacon(2, etx, 3)
    mote.think()
    assert mote.ctp.parent == 1
    mote.beacon(1, 10, options=CONGESTED)
    assert mote.ctp.parent == parent


def test_who_is_congested_becomes_nobodys_parent() -> None:
    mote = Mote(rules=CtpRules(congestion=True))
    mote.beacon(1, 40, 3)
    mote.beacon(2, 10, 3, options=CONGESTED)
    mote.think()
    assert mote.ctp.parent == 1
    mote.beacon(2, 10)
    mote.think()
    assert mote.ctp.parent == 2


def test_without_the_rule_nobody_minds_a_congested_parent() -> None:
    mote = Mote()
    mote.beacon(1, 10, 3)
    mote.think()
    mote.beacon(2, 9, 3)
    mote.beacon(1, 10, options=CONGESTED)
    mote.think()
    assert mote.ctp.parent == 1


@pytest.mark.parametrize(('lost', 'parent'), [(7, 1), (8, None)])
def test_a_link_of_exactly_five_transmissions_is_not_used(lost: int, parent: int | None) -> None:
    mote = Mote()
    for sequence in (0, lost + 1):  # 2 of 9 beacons came, or 2 of 10: 4.5 or 5 transmissions
        beacon = CtpBeacon(sequence, 0, 7, 20).pack()
        mote.ctp.receive(Received(BROADCAST, 1, CtpBeacon.AM_TYPE, beacon, 100, -80))
    mote.think()
    assert mote.ctp.parent == parent


@pytest.mark.parametrize(('packets', 'options'), [(6, 0), (7, CONGESTED)])
def test_a_queue_of_more_than_half_is_told_as_congestion(packets: int, options: int) -> None:
    mote = Mote(rules=CtpRules(congestion=True)).with_parent()
    for number in range(packets):
        mote.data(number)
    mote.ctp._routing.trigger_immediate_update()
    mote.node.run_binary_ms(128)
    assert [one.options for one in mote.told()] == [options]


@pytest.mark.parametrize(('etx', 'loops'), [(10, 1), (11, 0)])
def test_a_packet_of_the_same_cost_tells_of_a_loop_and_one_of_a_higher_cost_does_not(
        etx: int, loops: int) -> None:
    mote = Mote().with_parent()
    payload = CtpData(0, 0, etx, 9, 0, 0x93, b'hello').pack()
    mote.ctp.receive(Received(ME, 9, CtpData.AM_TYPE, payload, 100, -80))
    assert mote.ctp.counters['loops'] == loops
