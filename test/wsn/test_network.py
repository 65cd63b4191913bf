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

"""Run networks of a simple protocol and compare what they do with the rules of the radio."""

from __future__ import annotations

from flooding import FirstHeard
import pytest

from rt_robot_os.wsn.radio.mac import MAC_PROFILES
from rt_robot_os.wsn.radio.mac import TINYOS2
from rt_robot_os.wsn.radio.path_loss import PathLoss
from rt_robot_os.wsn.simulator.air import Link
from rt_robot_os.wsn.simulator.gain_medium import GainMedium
from rt_robot_os.wsn.simulator.link_medium import LinkMedium
from rt_robot_os.wsn.simulator.medium import Medium
from rt_robot_os.wsn.simulator.mote import Traffic
from rt_robot_os.wsn.simulator.network import Network
from rt_robot_os.wsn.simulator.path_loss_medium import PathLossMedium

S = 1_000_000_000
QUIET = [-98] * 10
SECOND = Traffic(S, lambda mote, number: number.to_bytes(18, 'big'), jitter_ns=S // 2)


def chain(medium: Medium, mac=TINYOS2, motes: int = 4, seed: int = 1, traffic=SECOND) -> Network:
    network = Network(medium, FirstHeard, mac=mac, seed=seed)
    for address in range(motes):
        network.add(address, (10.0 * address, 0.0, 1.0), is_root=address == 0,
                    traffic=traffic if address else None)
    return network


def gains(mac=TINYOS2, gain_db: float = -80.0, noise=QUIET, motes: int = 4) -> GainMedium:
    medium = GainMedium(noise, mac)
    for address in range(motes - 1):
        medium.set_gain(address, address + 1, gain_db)
        medium.set_gain(address + 1, address, gain_db)
    return medium


def links(rate: float, mac=TINYOS2, motes: int = 4) -> LinkMedium:
    medium = LinkMedium(mac)
    for address in range(motes - 1):
        medium.set_link(address, address + 1, Link(rate, -70, 106))
        medium.set_link(address + 1, address, Link(rate, -70, 106))
    return medium


@pytest.mark.parametrize('mac', MAC_PROFILES.values(), ids=MAC_PROFILES)
def test_a_chain_of_good_links_delivers_nearly_all(mac):
    network = chain(gains(mac), mac)
    network.run_until(100 * S)
    for address in (1, 2, 3):
        mote = network.motes[address]
        assert mote.router.hops == address
        assert mote.generated == pytest.approx(100, abs=2)
        assert mote.delivered >= 0.95 * mote.generated
    assert max(network.latencies_ns) < S


def test_one_seed_gives_one_run_and_another_one_another():
    def outline(seed: int) -> list[int]:
        network = chain(links(0.8), seed=seed)
        network.run_until(60 * S)
        return [network.queue.executed, network.duplicates, *network.medium.outcomes,
                *network.latencies_ns]

    assert outline(5) == outline(5)
    assert outline(5) != outline(6)


def test_a_signal_below_the_noise_is_not_heard():
    network = chain(gains(gain_db=-99.0))
    network.run_until(60 * S)
    assert [mote.router.parent for mote in network.motes.values()] == [None] * 4


def test_frames_of_fixed_links_arrive_at_their_rate():
    network = chain(links(0.5), motes=2)
    network.run_until(1000 * S)
    outcomes = network.medium.outcomes
    assert outcomes[0] / sum(outcomes[:2]) == pytest.approx(0.5, abs=0.05)


def test_a_dead_mote_is_silent_until_it_boots():
    network = chain(links(1.0))
    network.run_until(20 * S)
    network.motes[2].kill()
    sent = network.motes[2].radio.sent_frames
    network.run_until(40 * S)
    assert network.motes[2].radio.sent_frames == sent
    network.motes[2].boot()
    network.run_until(60 * S)
    assert network.motes[2].radio.sent_frames > sent
    assert network.motes[2].boots == 2


def test_a_mote_that_moves_away_is_lost_and_comes_back():
    network = chain(PathLossMedium(PathLoss(shadowing_db=0, asymmetry_db=0), QUIET, TINYOS2))
    network.run_until(20 * S)
    before = network.motes[3].delivered
    network.move(3, (100_000.0, 0.0, 0.0))
    network.run_until(40 * S)
    away = network.motes[3].delivered
    assert away - before <= 1
    network.move(3, (30.0, 0.0, 0.0))
    network.run_until(60 * S)
    assert network.motes[3].delivered - away > 15
