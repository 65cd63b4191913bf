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


"""Scenarios run: counted by truth, the same for a seed, with what happens to them."""

from __future__ import annotations

from collections import Counter
import io
import json
from pathlib import Path
import struct

import pytest

from rt_robot_os.features.wsn.cli.command import run
from rt_robot_os.features.wsn.cli.scenario_file import find_scenario
from rt_robot_os.features.wsn.cli.scenario_file import load_scenario
from rt_robot_os.features.wsn.packets.ieee802154 import AckFrame
from rt_robot_os.features.wsn.packets.ieee802154 import check_sequence_fits
from rt_robot_os.features.wsn.packets.ieee802154 import read_frame
from rt_robot_os.features.wsn.radio.mac import MAC_PROFILES
from rt_robot_os.features.wsn.simulator.air_log import AirLog
from rt_robot_os.features.wsn.simulator.network import Network
from rt_robot_os.features.wsn.simulator.simulation import Simulation

CHAIN = """
0 1 1.0 -78 106
1 0 1.0 -79 106
1 2 1.0 -78 106
2 1 1.0 -79 106
2 3 1.0 -78 106
3 2 1.0 -79 106
"""


@pytest.fixture
def chain(tmp_path: Path) -> Path:
    (tmp_path / 'chain.txt').write_text(CHAIN)
    path = tmp_path / 'chain.yaml'
    path.write_text('seconds: 200\nbeacon_period_ms: 2000\ntopology: {links: chain.txt}\n'
                    'traffic: {period_ms: 2000}\n')
    return path


def simulated(path: Path, *assignments: str, on_frame=None) -> Simulation:
    simulation = Simulation(*load_scenario(path, assignments=assignments), on_frame)
    simulation.run(watch_tree=True)
    return simulation


def test_the_tree_of_a_chain_is_the_chain(chain: Path) -> None:
    results = simulated(chain).results()
    assert results.parents == {1: 0, 2: 1, 3: 2}
    assert results.hops == {1: 1, 2: 2, 3: 3}
    assert results.beacon_costs == {0: 0, 1: 216, 2: 432, 3: 648}
    assert results.delivery > 0.98
    assert results.load_ratio > 1.4


@pytest.mark.parametrize('protocol', ['multihoplqi', 'paper', 'ctp'])
def test_a_seed_gives_the_same_each_time_and_another_one_another(
    chain: Path, protocol: str,
) -> None:
    path = chain.with_name('again.yaml')
    path.write_text(f'seconds: 60\nprotocol: {protocol}\ntopology: {{links: chain.txt}}\n')

    def found(seed: int) -> dict:
        results = simulated(path, f'seed={seed}').results().as_json()
        return {key: value for key, value in results.items()
                if key not in ('wall_s', 'times_real_time', 'seed')}
    assert found(1) == found(1)
    assert found(1) != found(2)
    assert sum(found(1)['delivered'].values()) > 30


def test_a_link_that_ends_and_begins_again_is_a_gap_as_long(chain: Path) -> None:
    text = CHAIN + '@ 60 3 2 0\n@ 60 2 3 0\n@ 120 3 2 1 -78 106\n@ 120 2 3 1 -78 106\n'
    chain.with_name('chain.txt').write_text(text)
    results = simulated(chain).results()
    gap, = (each for each in results.gaps if each.lost > 10)
    assert gap.origin == 3
    assert 58 < (gap.end_ns - gap.begin_ns) / 1e9 < 70
    assert results.generated[3] - results.delivered[3] >= gap.lost


@pytest.mark.parametrize('text, missing', [
    ('kill 3 at 100', 0.5), ('reboot 3 at 100 for 50', 0.25), ('silence 3 at 100 for 50', 0.25),
    ('sleep 3 at 50 for 100', 0.5), ('boot 3 at 100', 0.5)])
def test_what_happens_to_a_node_happens(chain: Path, text: str, missing: float) -> None:
    results = simulated(chain, f'faults=[{text}]').results()
    assert results.generated[3] == pytest.approx(100 * (1 - missing), abs=4)
    assert results.generated[2] == pytest.approx(100, abs=2)


def test_noise_for_a_while_costs_packets_then(tmp_path: Path) -> None:
    path = tmp_path / 'grid.yaml'
    path.write_text('seconds: 60\nprotocol: ctp\ntopology: {grid: 1x3}\n'
                    'faults: [noise 60 at 20 for 20]\ntraffic: {period_ms: 1000}\n')
    simulation = simulated(path)
    bad = [made_ns / 1e9 for _, made_ns, took_ns in simulation.statistics.fates()
           if not 0 <= took_ns < 1e9]
    during = [at_s for at_s in bad if 15 < at_s < 41]
    assert len(during) > 10
    assert len(bad) - len(during) < 0.3 * len(during)


def test_a_moving_sink_is_where_its_way_leads(tmp_path: Path) -> None:
    path = tmp_path / 'grid.yaml'
    path.write_text('seconds: 20\nprotocol: paper\ntopology: {grid: 2x2}\n'
                    'sink: {speed_m_s: 1.0, way: [0 0, 10 0]}\n')
    simulation = simulated(path, 'seconds=5')
    assert simulation.network.motes[0].position == pytest.approx((5.0, 0.0, 1.5), abs=0.11)


def test_the_air_log_holds_each_frame_in_order(chain: Path) -> None:
    for protocol in ('paper', 'ctp'):
        path = chain.with_name('air.yaml')
        path.write_text(f'seconds: 20\nprotocol: {protocol}\ntopology: {{links: chain.txt}}\n')
        file = io.BytesIO()
        scenario, topology = load_scenario(path)
        log = AirLog(file, MAC_PROFILES[scenario.radio.mac])
        simulation = Simulation(scenario, topology, log)
        simulation.run()
        log.flush()
        results = simulation.results()
        data, times, acks = file.getvalue()[24:], [], 0
        while data:
            seconds, ns, size, _ = struct.unpack('<IIII', data[:16])
            frame = bytes((size,)) + data[16:16 + size]
            assert check_sequence_fits(frame)
            acks += isinstance(read_frame(frame), AckFrame)
            times.append(seconds * 1_000_000_000 + ns)
            data = data[16 + size:]
        assert times == sorted(times)
        assert len(times) == log.frames == results.transmissions + acks
        assert abs(acks - results.acks) <= 1


def test_the_command_writes_json_and_files(
    chain: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(['simulate', str(chain), '--seconds', '30', '--json', '--csv',
                str(tmp_path / 'out'), '--pcap', str(tmp_path / 'air.pcap'), '--no-fcs']) == 0
    found = json.loads(capsys.readouterr().out)
    assert {'scenario', 'protocol', 'seed', 'seconds', 'generated', 'delivered', 'duplicates',
            'data_transmissions', 'beacons', 'acks', 'transmissions', 'delivery',
            'delivery_by_node', 'transmissions_per_delivery', 'all_transmissions_per_delivery',
            'latency_ms', 'parents', 'costs', 'hops', 'beacon_costs', 'relay_load', 'energy',
            'first_empty_days', 'events', 'wall_s', 'times_real_time'} <= set(found)
    assert found['transmissions'] == found['data_transmissions'] + found['beacons']
    packets = (tmp_path / 'out' / 'packets.csv').read_text().splitlines()
    assert len(packets) == 1 + sum(found['generated'].values())
    assert sorted(path.name for path in (tmp_path / 'out').iterdir()) == [
        'links.csv', 'nodes.csv', 'packets.csv', 'tree.csv']
    assert (tmp_path / 'air.pcap').read_bytes()[20:24] == b'\xe6\0\0\0'


def test_the_command_says_what_is_wrong_and_runs_nothing(
    chain: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(['simulate', str(chain), '--set', 'protocl=ctp', '--set', 'seed=x']) == 2
    said = capsys.readouterr().err
    assert "protocl: unknown key, did you mean 'protocol'?" in said
    assert 'seed' in said
    assert run(['simulate', str(chain), '--picture', '/nowhere/a.png']) == 2


def test_variants_stand_side_by_side(
    chain: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    path = chain.with_name('random.yaml')
    path.write_text('seconds: 20\ntopology: {random: 12, width_m: 30, depth_m: 30}\n')
    assert run(['simulate', str(path), '--seeds', '2', '--jobs', '1', '--sink', 'both', '--sizes',
                '8,9', '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found['columns']) == ['8 fixed', '8 moving', '9 fixed', '9 moving']
    assert [one['nodes'] for one in found['runs']['8 moving']] == [8, 8]
    assert found['columns']['8 fixed']['delivery']['unit'] == '%'


def test_ctrl_c_shows_what_there_is(
    chain: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    whole = Network.run_until

    def interrupted(self: Network, time_ns: int) -> None:
        if time_ns > 50_000_000_000:
            raise KeyboardInterrupt
        whole(self, time_ns)

    monkeypatch.setattr(Network, 'run_until', interrupted)
    assert run(['simulate', str(chain), '--json']) == 130
    assert json.loads(capsys.readouterr().out)['seconds'] == 50.0
    assert run(['simulate', str(chain), '--seeds', '2', '--jobs', '1']) == 130
    assert 'no run was completed' in capsys.readouterr().out


def test_figure_6_of_the_paper_takes_the_way_of_the_paper() -> None:
    simulation = Simulation(*load_scenario(find_scenario('figure6')))
    ways: Counter[tuple[int | None, ...]] = Counter()
    for second in range(20, 120):
        simulation.network.run_until(second * 1_000_000_000)
        parents = simulation.results().parents
        ways[tuple(parents[each] for each in (6, 5, 3))] += 1
    assert ways.most_common(1)[0][0] == (5, 3, 0)
    assert ways[5, 3, 0] > 60
