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
The Collection Tree Protocol in whole networks, against TOSSIM and real firmware.

The long comparisons, all topologies and noises with three seeds each, run when RT_ROBOT_OS_BROAD
is set; they take half a minute. ``wsn compare`` does the same for a folder of other references.
"""

from __future__ import annotations

from functools import cache
from functools import partial
import json
import os
from pathlib import Path
from random import Random
from statistics import fmean
from typing import NamedTuple

import pytest
from rt_robot_os.features.wsn.radio.mac import TINYOS2
from rt_robot_os.features.wsn.radio.mac import TOSSIM as TOSSIM_MAC
from rt_robot_os.features.wsn.radio.noise import closest_pattern
from rt_robot_os.features.wsn.radio.noise import quiet
from rt_robot_os.features.wsn.radio.noise import read_trace
from rt_robot_os.features.wsn.radio.noise import TOSSIM_LEARNS
from rt_robot_os.features.wsn.radio.path_loss import PathLoss
from rt_robot_os.features.wsn.routing.ctp import Ctp
from rt_robot_os.features.wsn.routing.ctp_rules import CtpRules
from rt_robot_os.features.wsn.routing.ctp_rules import TOSSIM
from rt_robot_os.features.wsn.routing.protocol import BINARY_MS_NS
from rt_robot_os.features.wsn.simulator.gain_medium import GainMedium
from rt_robot_os.features.wsn.simulator.link_medium import Link
from rt_robot_os.features.wsn.simulator.link_medium import LinkMedium
from rt_robot_os.features.wsn.simulator.mote import Mote
from rt_robot_os.features.wsn.simulator.mote import Traffic
from rt_robot_os.features.wsn.simulator.network import Network
from rt_robot_os.features.wsn.simulator.path_loss_medium import PathLossMedium

BROAD = pytest.mark.skipif(not os.environ.get('RT_ROBOT_OS_BROAD'),
                           reason='long: set RT_ROBOT_OS_BROAD')
NS_PER_S = 1_000_000_000
PERIOD_NS = round(800 * BINARY_MS_NS)
# A packet of TinyOS' MultihopOscilloscope.
PACKET_BYTES = 18


class Outcome(NamedTuple):
    """What became of a network."""

    delivery: float
    data_per_delivery: float
    frames_per_delivery: float
    beacons: int
    duplicates: int
    parents: dict[int, int | None]


def build(mote: Mote, number: int) -> bytes:
    """Make a packet."""
    del mote
    return number.to_bytes(4, 'big') + bytes(PACKET_BYTES - 4)


def outcome(network: Network) -> Outcome:
    """Count what a network did."""
    motes = network.motes.values()
    delivered = sum(mote.delivered for mote in motes)
    frames = sum(mote.radio.sent_frames for mote in motes)
    beacons = sum(mote.router.beacons for mote in motes if isinstance(mote.router, Ctp))
    return Outcome(
        delivered / sum(mote.generated for mote in motes), (frames - beacons) / delivered,
        frames / delivered, beacons, network.duplicates,
        {address: mote.router.parent for address, mote in network.motes.items()})


# ---- TOSSIM ---------------------------------------------------------------------------------


@cache
def trace(path: Path) -> list[int]:
    """Read a recording of noise."""
    return read_trace(path)


def tossim(wsn: Path, topology: str, noise: str, seed: int, seconds: int = 600) -> Outcome:
    """Run what a row of TOSSIM's reference says."""
    series = closest_pattern(trace(wsn / f'noise_{noise}.txt.gz')[:TOSSIM_LEARNS], Random(seed),
                             1 << 16 if seconds < 600 else 1 << 18)
    medium = GainMedium(series, TOSSIM_MAC)
    addresses = set()
    for line in (wsn / f'tossim_{topology}.topo.txt').read_text().splitlines():
        words = line.split()
        sender, receiver = int(words[1]), int(words[2])
        medium.set_gain(sender, receiver, float(words[3]))
        addresses |= {sender, receiver}
    network = Network(medium, lambda node, root: Ctp(node, root, TOSSIM), mac=TOSSIM_MAC,
                      seed=seed, drift_ppm=0)
    random = Random(seed)
    for address in sorted(addresses):
        network.add(address, is_root=address == 0, boot_ns=int(random.random() * NS_PER_S),
                    traffic=Traffic(PERIOD_NS, build) if address else None)
    network.run_until(seconds * NS_PER_S)
    return outcome(network)


def rows(wsn: Path, topology: str, noise: str) -> tuple[float, float]:
    """Return TOSSIM's delivery, and its frames for each packet delivered."""
    found = [row for row in json.loads((wsn / 'tossim_reference.json').read_text())
             if (row['variant'], row['topology'], row['noise']) == ('ctp', topology, noise)]
    return (fmean([row['ddr'] for row in found]),
            fmean([row['transmissions'] / row['delivered'] for row in found]))


@pytest.mark.parametrize(('noise', 'within'), [('casino-lab', 0.03), ('meyer-heavy', 0.06)])
def test_a_chain_of_seven_delivers_as_in_tossim(data_dir: Path, noise: str,
                                                within: float) -> None:
    wsn = data_dir / 'wsn'
    delivery, frames = rows(wsn, 'chain7', noise)
    got = tossim(wsn, 'chain7', noise, 1, 150)
    assert got.delivery == pytest.approx(delivery, abs=within)
    assert got.frames_per_delivery == pytest.approx(frames, rel=0.15)


@BROAD
@pytest.mark.parametrize('topology', ['chain7', 'testmultihoplqi', 'grid16_medium'])
@pytest.mark.parametrize(('noise', 'within'), [('casino-lab', 0.03), ('meyer-heavy', 0.06)])
def test_every_topology_does_as_in_tossim(data_dir: Path, topology: str, noise: str,
                                          within: float) -> None:
    """The collapse of the grid under heavy noise is among them: 0.653 delivered, 11.35 frames."""
    wsn = data_dir / 'wsn'
    delivery, frames = rows(wsn, topology, noise)
    got = [tossim(wsn, topology, noise, seed) for seed in (1, 2, 3)]
    assert fmean([one.delivery for one in got]) == pytest.approx(delivery, abs=within)
    assert fmean([one.frames_per_delivery for one in got]) == pytest.approx(frames, rel=0.15)


# ---- firmware -------------------------------------------------------------------------------


def firmware(wsn: Path, name: str, seconds: float, seed: int) -> Outcome:
    """Run the network of emulated motes; packets begin when theirs began."""
    medium = LinkMedium(TINYOS2)
    for line in (wsn / f'mspsim_{name}.links.txt').read_text().splitlines():
        words = line.split()
        medium.set_link(int(words[0]), int(words[1]),
                        Link(float(words[2]), int(words[3]), int(words[4])))
    network = Network(medium, Ctp, mac=TINYOS2, seed=seed)
    started_ns = 4_267_000_000
    first_ns = {1: 10_352_000_000, 2: 10_437_000_000, 3: 10_284_000_000}
    for address in range(4):
        traffic = Traffic(5 * NS_PER_S, build, first_ns[address] - started_ns) if address else None
        network.add(address, is_root=address == 0, boot_ns=started_ns, traffic=traffic)
    network.run_until(int(seconds * NS_PER_S))
    return outcome(network)


@pytest.mark.parametrize(('name', 'seconds', 'data', 'within', 'beacons'), [
    ('chain4', 595.5, 1.53, 0.15, 61), ('lossy4', 895.5, 2.56, 0.20, 77)])
def test_motes_deliver_all_as_the_firmware_does(data_dir: Path, name: str, seconds: float,
                                                data: float, within: float, beacons: int) -> None:
    """In lossy4 the emulated radios miss more acknowledgements than their links are to lose."""
    got = [firmware(data_dir / 'wsn', name, seconds, seed) for seed in (1, 2, 3)]
    assert fmean([one.delivery for one in got]) >= 0.997
    assert fmean([one.data_per_delivery for one in got]) == pytest.approx(data, rel=within)
    assert fmean([one.beacons for one in got]) == pytest.approx(beacons, rel=0.25)
    for one in got:
        assert one.parents[1] == 0
        assert one.parents[3] in (1, 2)
        assert one.parents[2] == {'chain4': 0, 'lossy4': 1}[name]
        assert 1 <= one.duplicates <= 60


# ---- at home --------------------------------------------------------------------------------


def home(seconds: int, seed: int, rules: CtpRules = CtpRules(), speed_m_s: float = 0.0,
         exponent: float = 2.7) -> Network:
    """Make twelve nodes on a floor of 15 m x 12 m, at the least power, with several hops."""
    medium = PathLossMedium(PathLoss(exponent=exponent, shadowing_db=4.0),
                            quiet(Random(seed), 1 << 15), TINYOS2)
    network = Network(medium, lambda node, root: Ctp(node, root, rules), seed=seed)
    for address in range(13):
        place = (5.0 * (address % 4), 4.0 * (address // 4), 1.0)
        network.add(address, place, is_root=address == 0, power_dbm=-25.0,
                    traffic=Traffic(PERIOD_NS, build) if address else None)
    if speed_m_s:
        for half_second in range(2 * seconds):
            place = along_the_walls(speed_m_s * half_second / 2)
            network.at(half_second * NS_PER_S // 2, partial(network.move, 0, place))
    network.run_until(seconds * NS_PER_S)
    return network


def along_the_walls(way_m: float) -> tuple[float, float, float]:
    """Return where a sink is that drives round the floor."""
    way_m %= 54.0
    if way_m < 15.0:
        return way_m, 0.0, 0.4
    if way_m < 27.0:
        return 15.0, way_m - 15.0, 0.4
    if way_m < 42.0:
        return 42.0 - way_m, 12.0, 0.4
    return 0.0, 54.0 - way_m, 0.4


def test_a_home_loses_less_than_one_packet_in_two_hundred() -> None:
    got = outcome(home(300, 1))
    assert got.delivery >= 0.995
    assert len([parent for parent in got.parents.values() if parent not in (None, 0)]) >= 3


def test_a_sink_that_drives_must_tell_of_itself_often() -> None:
    stock, often = CtpRules(), CtpRules(longest_interval_ms=1024)
    assert outcome(home(60, 3, stock, 0.3, 3.0)).delivery < 0.8
    told = outcome(home(60, 3, often, 0.3, 3.0))
    assert told.delivery >= 0.98


@BROAD
def test_a_home_does_so_for_half_an_hour_whatever_the_seed() -> None:
    for seed in range(1, 6):
        assert outcome(home(1800, seed)).delivery >= 0.995
