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

"""Writing to a mote until it acknowledges, and acknowledging what it sends."""

from __future__ import annotations

from collections.abc import Callable
import random

import pytest

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.framing import TINYOS_2
from rt_robot_os.features.wsn.packets.serial_link import Link

WAIT_NS = 250 * NS_PER_MS


def test_a_packet_is_written_with_a_token_and_acknowledged() -> None:
    link = Link(TINYOS_1)
    assert link.next_ns is None
    assert link.send(b'\xaa\xbb') == 1
    assert link.next_ns == 0
    # As TinyOS' own program has written it.
    assert link.poll(0) == bytes.fromhex('7e4126aabb4bc87e')
    assert (link.poll(0), link.next_ns) == (b'', WAIT_NS)
    assert link.feed(bytes.fromhex('7e402668497e')) == []
    assert [tuple(each) for each in link.take_outcomes()] == [(1, b'\xaa\xbb', True, 1)]
    assert (link.acknowledged, link.waiting, link.next_ns) == (1, 0, None)


def test_packets_go_one_after_the_other_each_with_the_next_token() -> None:
    link = Link(TINYOS_2, first_token=0xFF)
    assert [link.send(b'%d' % each) for each in range(3)] == [1, 2, 3]
    for token, packet in ((0xFF, b'0'), (0, b'1'), (1, b'2')):
        written = link.poll(0)
        assert written == frame(0x44, bytes((token,)) + packet)
        link.feed(frame(0x43, bytes((token,))))
    assert link.acknowledged == 3


def test_what_is_not_acknowledged_is_written_three_times_and_given_up() -> None:
    link = Link(TINYOS_2)
    link.send(b'lost')
    link.send(b'next')
    wire = frame(0x44, b'\x26lost')
    times = []
    now = 0
    while (data := link.poll(now)) == wire or not data:
        times += [now] if data else []
        now += NS_PER_MS
    assert times == [0, WAIT_NS, 2 * WAIT_NS]
    assert (now, data) == (3 * WAIT_NS, frame(0x44, b'\x27next'))
    assert [tuple(each) for each in link.take_outcomes()] == [(1, b'lost', False, 3)]
    assert (link.given_up, link.resends) == (1, 2)
    # Late answers to it are no answers to the next.
    link.feed(frame(0x43, b'\x26') + frame(0x40, b'\x27'))
    assert (link.stray_acks, link.waiting) == (2, 1)


def test_a_resent_frame_that_arrives_twice_is_acknowledged_once() -> None:
    link = Link(TINYOS_1)
    link.send(b'x')
    link.poll(0)
    link.poll(WAIT_NS)
    link.feed(frame(0x40, b'\x26') * 2)
    assert (link.acknowledged, link.stray_acks) == (1, 1)


@pytest.mark.parametrize(('sent', 'answer'), [
    ('7e4126aabb4bc87e', '7e402668497e'),
    ('7e441100ffff00010a7d5d930001020304057d5d7d5e0809adb47e', '7e43118f5a7e')])
def test_a_frame_that_wants_an_acknowledgement_gets_it(sent: str, answer: str) -> None:
    link = Link(TINYOS_1)
    found, = link.feed(bytes.fromhex(sent))
    assert found.packet and link.next_ns == 0
    assert link.poll(0) == bytes.fromhex(answer)
    assert (link.answered, link.poll(0)) == (1, b'')


def test_answers_and_the_queue_are_bounded() -> None:
    link = Link(TINYOS_2, capacity=2)
    assert [link.send(b'x') for _ in range(4)] == [1, 2, 0, 0]
    assert link.refused == 2
    link.feed(frame(0x44, b'\x01abc') * 1000)
    assert (link.answered, link.answers_dropped) == (64, 936)
    with pytest.raises(ValueError, match='256'):
        link.send(bytes(300))


def test_a_reset_gives_up_what_waits() -> None:
    link = Link(TINYOS_2)
    link.send(b'a')
    link.send(b'b')
    link.poll(0)
    link.feed(b'\x7e\x45half')
    link.reset()
    assert [each.acknowledged for each in link.take_outcomes()] == [False, False]
    assert (link.reader.pending_bytes, link.next_ns, link.given_up) == (0, None, 2)


def lossy(chance: random.Random, loss: float) -> Callable[[bytes], bytes]:
    def carry(data: bytes) -> bytes:
        return b'' if chance.random() < loss else data
    return carry


def test_over_a_line_that_loses_frames_every_outcome_is_true() -> None:
    chance = random.Random(14)
    carry = lossy(chance, 0.3)
    host, mote = Link(TINYOS_2), FrameReader()
    taken: list[bytes] = []
    outcomes = {}
    now = 0
    for number in range(200):
        assert host.send(b'%d' % number)
        while host.waiting:
            for found in mote.feed(carry(host.poll(now))):
                taken.append(found.packet)
                host.feed(carry(frame(0x43, bytes((found.token,)))))
            now = max(now, host.next_ns or 0)
        outcomes.update({each.packet: each for each in host.take_outcomes()})
    assert len(outcomes) == 200
    assert all(packet in taken for packet, each in outcomes.items() if each.acknowledged)
    failed = [each for each in outcomes.values() if not each.acknowledged]
    # Three tries, each there and back: 0.51 ** 3.
    assert 5 < len(failed) < 60 and {each.tries for each in failed} == {3}
    assert host.given_up == len(failed) and host.acknowledged == 200 - len(failed)
