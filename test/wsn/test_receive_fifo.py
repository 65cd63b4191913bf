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


"""The receive FIFO of an emulated CC2420 after a frame was cut off, alone and in a network."""

from __future__ import annotations

import csv
import gzip
from pathlib import Path

import pytest
from rt_robot_os.features.wsn.radio.mac import TINYOS2
from rt_robot_os.features.wsn.routing.ctp import Ctp
from rt_robot_os.features.wsn.simulator.air import ACK
from rt_robot_os.features.wsn.simulator.air import Transmission
from rt_robot_os.features.wsn.simulator.air_log import bytes_of
from rt_robot_os.features.wsn.simulator.link_medium import Link
from rt_robot_os.features.wsn.simulator.link_medium import LinkMedium
from rt_robot_os.features.wsn.simulator.mote import Mote
from rt_robot_os.features.wsn.simulator.network import Network
from rt_robot_os.features.wsn.simulator.receive_fifo import in_fifo
from rt_robot_os.features.wsn.simulator.receive_fifo import ReceiveFifo

MS = 1_000_000
S = 1000 * MS
KEPT = TINYOS2._replace(keeps_cut_off=True)


class Sender:
    """Stands for the radio of a frame."""

    address = 2
    near = ([],)
    pan = 0x22


def frame(begin_ns: int, payload: bytes = bytes(26), am_type: int = 0x71,
          dsn: int = 7) -> Transmission:
    mpdu = 5 if am_type == ACK else 13 + len(payload)
    return Transmission(Sender(), 9, am_type, payload, am_type != ACK, dsn, begin_ns,
                        begin_ns + (6 + mpdu) * 32_000)


def completed(fifo: ReceiveFifo, one: Transmission) -> list[Transmission | None]:
    data = in_fifo(bytes_of(one, 2), 106, -80)
    return [arrival.frame for arrival in fifo.complete(one, data)]


def test_a_mote_in_step_reads_a_frame_and_the_acknowledgement_that_follows():
    fifo = ReceiveFifo()
    first = frame(0)
    ack = frame(first.end_ns + 783_000, b'', ACK)
    assert completed(fifo, first) == [first]
    assert completed(fifo, ack) == [ack]
    assert fifo.is_in_step


def test_behind_a_cut_off_frame_nothing_is_read_until_the_fifo_overflows():
    fifo = ReceiveFifo()
    cut = frame(0)
    assert fifo.cut_off(bytes_of(cut, 2)[:30], MS) == []
    # 98 bytes are free: two frames of 40 and three acknowledgements of 6 fit in.
    later = [frame(number * 100 * MS, *(() if number < 3 else (b'', ACK)))
             for number in range(1, 6)]
    for one in later:
        assert completed(fifo, one) == []
    ack = frame(S, b'', ACK)
    assert completed(fifo, ack) == []
    afterwards = frame(2 * S, b'', ACK)
    assert completed(fifo, afterwards) == [afterwards]


def test_what_begins_before_the_flush_is_lost():
    fifo = ReceiveFifo()
    fifo.cut_off(bytes_of(frame(0), 2)[:30], MS)
    for number in range(1, 3):
        completed(fifo, frame(number * 100 * MS))
    full = frame(S)
    assert completed(fifo, full) == []
    assert completed(fifo, frame(full.end_ns + 200_000, b'', ACK)) == []
    after = frame(full.end_ns + 20 * MS)
    assert completed(fifo, after) == [after]


def test_a_mote_out_of_step_leaves_the_acknowledgement_behind_a_frame_unread():
    fifo = ReceiveFifo()
    fifo.cut_off(bytes_of(frame(0), 2)[:30], MS)
    for number in range(1, 4):
        completed(fifo, frame(number * 100 * MS))
    assert not fifo.is_in_step
    alone = frame(2 * S, b'', ACK)
    assert completed(fifo, alone) == [alone]
    first = frame(3 * S)
    assert completed(fifo, first) == [first]
    assert completed(fifo, frame(first.end_ns + 783_000, b'', ACK)) == []
    assert completed(fifo, frame(4 * S, b'', ACK)) == []


def test_the_six_acknowledgements_that_real_firmware_missed_in_chain4(data_dir: Path):
    """Node 3 cut off a frame of node 1 at 220.36 s, and was deaf until 220.56 s."""
    fifo = ReceiveFifo()
    missed, read = [], []
    path = data_dir / 'wsn' / 'mspsim_chain4_ctp.air.csv.gz'
    with gzip.open(path, 'rt', newline='') as lines:
        for row in csv.DictReader(lines):
            begin_ns = int(row['t_us']) * 1000
            data = bytes.fromhex(row['mpdu_hex_with_length_byte'])
            if not 220_357 * MS < begin_ns < 226 * S or '3' not in row['received_by'].split():
                continue
            if fifo.is_in_step and not missed:
                # Its own frame began at 220.358874 s; the radio turned 224 us before.
                fifo.cut_off(data[:(220_358_650_000 - begin_ns) // 32_000 - 5], begin_ns)
                missed.append(-1)
                continue
            is_ack = data[0] == 5
            one = frame(begin_ns, data[12:-2], ACK if is_ack else data[11], data[3])
            got = [arrival.frame for arrival in fifo.complete(one, in_fifo(data, 85, -93))]
            if is_ack:
                (read if one in got else missed).append(data[3])
    assert missed[1:] == [95, 96, 98, 99, 100, 101]
    assert read[0] == 102


@pytest.mark.parametrize('mac', [TINYOS2, KEPT])
def test_a_node_that_sends_into_a_frame_is_deaf_only_where_the_fifo_keeps_it(mac):
    medium = LinkMedium(mac)
    for pair in ((0, 1), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1)):
        medium.set_link(*pair, Link(1.0, -90, 106))
    network = Network(medium, Ctp, mac=mac, seed=1, drift_ppm=0)
    for address in range(3):
        network.add(address, is_root=address == 0)
    network.run_until(30 * S)
    one, two = network.motes[1], network.motes[2]
    assert medium.received_by(two.radio, network.queue.now_ns) is None
    send_into(network, one, two)
    deaf = mac is KEPT
    assert two.radio.cut_off_frames == deaf
    before = two.radio.received_frames
    one.sender(lambda acked: results.append(acked)).send(2, 0x50, bytes(20), True)
    results: list[bool] = []
    network.run_until(network.queue.now_ns + S)
    assert results == [not deaf]
    assert (two.radio.received_frames > before) == (not deaf)
    assert (two.radio.unread_frames > 0) == deaf
    two.kill()
    two.boot()
    one.sender(lambda acked: results.append(acked)).send(2, 0x50, bytes(20), True)
    network.run_until(network.queue.now_ns + S)
    assert results[-1]


def send_into(network: Network, one: Mote, two: Mote) -> None:
    """Let node 2 send while it receives a frame of node 1."""
    one.sender(lambda acked: None).send(0, 0x50, bytes(26), False)
    while network.medium.received_by(two.radio, network.queue.now_ns - 500_000) is None:
        network.run_until(network.queue.now_ns + 10_000)
    sender = two.sender(lambda acked: None)
    sender.send(0, 0x50, bytes(4), False)
    # The back-off is over now.
    two.radio._transmit(network.queue.now_ns)
    network.queue.cancel(two.radio._event)
    two.radio._event.call = two.radio._sent
    network.queue.at(two.radio._frame.end_ns, two.radio._event)
    network.run_until(network.queue.now_ns + 20 * MS)
