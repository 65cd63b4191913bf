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

"""Whole networks that run MultiHopLQI, as TOSSIM's and the emulated firmware's ran it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.oscilloscope import Oscilloscope
from rt_robot_os.features.wsn.radio import noise
from rt_robot_os.features.wsn.radio.mac import TINYOS2
from rt_robot_os.features.wsn.radio.mac import TOSSIM
from rt_robot_os.features.wsn.routing.multihop_lqi import MultiHopLqi2
from rt_robot_os.features.wsn.routing.protocol import BINARY_MS_NS
from rt_robot_os.features.wsn.simulator import link_files
from rt_robot_os.features.wsn.simulator.air import Link
from rt_robot_os.features.wsn.simulator.gain_medium import GainMedium
from rt_robot_os.features.wsn.simulator.link_medium import LinkMedium
from rt_robot_os.features.wsn.simulator.mote import Mote
from rt_robot_os.features.wsn.simulator.mote import Traffic
from rt_robot_os.features.wsn.simulator.network import Network

SECOND_NS = 1_000_000_000
TOSSIM_PERIOD_NS = round(800 * BINARY_MS_NS)
FIRMWARE_PERIOD_NS = round(5120 * BINARY_MS_NS)
#: The emulated motes start 4.3 s after the recording, and hand on the first packet at 10 s.
FIRMWARE_START_NS = 4_270_000_000


class Outcome(NamedTuple):
    """
    What became of a run.

    :ivar costs: that each node advertised.
    """

    network: Network
    costs: dict[int, set[int]]

    @property
    def generated(self) -> int:
        """Return how many packets the applications made."""
        return sum(mote.generated for mote in self.network.motes.values())

    @property
    def delivery(self) -> float:
        """Return the share of the packets that the sink got."""
        return sum(mote.delivered for mote in self.network.motes.values()) / self.generated

    @property
    def transmissions_per_delivery(self) -> float:
        """Return how many frames there were for each packet, beacons included."""
        frames = sum(mote.radio.sent_frames for mote in self.network.motes.values())
        return frames / (self.delivery * self.generated)

    @property
    def parents(self) -> dict[int, int | None]:
        """Return the parents at the end."""
        return {address: mote.router.parent for address, mote in self.network.motes.items()}

    @property
    def beacons(self) -> int:
        """Return how many beacons there were."""
        return sum(mote.router.counters['beacons'] for mote in self.network.motes.values())


def _reading(mote: Mote, number: int) -> bytes:
    return Oscilloscope(0, 1024, mote.address, number & 0xFFFF, number.to_bytes(10, 'big')).pack()


def _run(network: Network, addresses: Sequence[int], boots_ns: Sequence[int], traffic: Traffic,
         seconds: float) -> Outcome:
    costs: dict[int, set[int]] = {address: set() for address in addresses}

    def note(now_ns: int, mote: Mote, event: str, numbers: tuple[int, ...]) -> None:
        if event == 'beacon_sent':
            costs[mote.address].add(numbers[2])

    network.on_note = note
    for address, boot_ns in zip(addresses, boots_ns):
        network.add(address, is_root=address == 0, boot_ns=boot_ns,
                    traffic=traffic if address else None)
    network.run_until(round(seconds * SECOND_NS))
    return Outcome(network, costs)


def tossim(topology: Path, trace: Sequence[int], beacon_period_ns: int, seed: int,
           seconds: float = 600) -> Outcome:
    """
    Run a network of TOSSIM.

    :param trace: of the noise.
    """
    random = Random(seed)
    series = noise.closest_pattern(trace[:noise.TOSSIM_LEARNS], random)
    medium = GainMedium(series, TOSSIM)
    gains = link_files.read_gains(str(topology))
    for (source, to), gain_db in gains.items():
        medium.set_gain(source, to, gain_db)
    network = Network(
        medium, lambda node, root: MultiHopLqi2(node, root, beacon_period_ns, u16_wrap=False),
        mac=TOSSIM, seed=seed, drift_ppm=0)
    addresses = sorted({node for pair in gains for node in pair})
    boots_ns = [random.randrange(SECOND_NS) for _ in addresses]
    traffic = Traffic(TOSSIM_PERIOD_NS, _reading, first_ns=TOSSIM_PERIOD_NS)
    return _run(network, addresses, boots_ns, traffic, seconds)


def firmware(links: Path, seed: int, seconds: float, *, u16_wrap: bool = True) -> Outcome:
    """Run a network as on emulated motes: a list of links, which may change in time."""
    medium = LinkMedium(TINYOS2)
    network = Network(medium, lambda node, root: MultiHopLqi2(node, root, u16_wrap=u16_wrap),
                      seed=seed)
    table, changes = link_files.read_links(str(links))
    addresses = sorted({node for pair in table for node in pair})
    for (source, to), link in table.items():
        medium.set_link(source, to, Link(link.prr, link.rssi_dbm, link.lqi))
    for change in changes:
        def let(change: link_files.LinkChange = change) -> None:
            link = change.link
            medium.set_link(change.source, change.destination,
                            Link(link.prr, link.rssi_dbm, link.lqi))
        network.at(change.at_ns, let)
    random = Random(seed)
    boots_ns = [FIRMWARE_START_NS + random.randrange(SECOND_NS // 5) for _ in addresses]
    traffic = Traffic(FIRMWARE_PERIOD_NS, _reading, first_ns=10 * SECOND_NS - FIRMWARE_START_NS)
    return _run(network, addresses, boots_ns, traffic, seconds)
