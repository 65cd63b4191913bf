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
The settings of a scenario, and checks across them.

The YAML file is read elsewhere. Units are in the names. The default of a setting that is ``None``
depends on the rest of the scenario; :func:`settled` sets it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace
from typing import Any
from typing import Final

from rt_robot_os.base.schema import setting
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.routing.protocol import BINARY_MS_NS

PROTOCOLS: Final = ('multihoplqi', 'paper', 'ctp')
PAYLOADS: Final = ('surge', 'data', 'oscilloscope')
PROFILES: Final = ('tinyos1', 'tinyos2', 'tossim')
MOST_NODES: Final = 100_000
#: Addresses have 16 bits, and two of them are reserved; more nodes are several networks.
MOST_NODES_A_PAN: Final = 65_534
_USUAL_DRIFT_PPM: Final = 20.0

#: An error: the dotted key, and the remedy.
Wrong = tuple[str, str]


@dataclass(frozen=True, slots=True)
class TopologySettings:
    """The positions of the nodes, or their links: exactly one of the first six keys."""

    grid: str = setting(
        '', 'rows x columns of a grid, such as 4x5; ids count from 0 along the rows')
    random: int = setting(
        0, 'number of nodes at random positions in the area, or in free cells of the map',
        minimum=0, maximum=MOST_NODES)
    nodes: tuple[str, ...] = setting(
        (), 'surveyed nodes: name x y height [id N] [quantity ...], such as "hall 3.0 1.5 2.2"')
    nodes_file: str = setting(
        '', 'a YAML file with such a list under the key nodes, such as the file of a world',
        is_file=True)
    links: str = setting(
        '', 'a file with a line "from to prr rssi lqi" for each link', is_file=True)
    tossim: str = setting(
        '', 'a file with a line "gain from to dB" for each link, as TOSSIM reads it',
        is_file=True)
    map: str = setting(  # noqa: A003
        '', 'a ROS map, whose walls attenuate signals; with grid, random or nodes',
        is_file=True)
    spacing_m: float = setting(30.0, 'distance of neighbours in the grid', 'm', 0.01, 1e4)
    jitter_m: float = setting(
        0.0, 'standard deviation of the offset of each node from the grid', 'm', 0.0, 1e4)
    width_m: float = setting(100.0, 'width (x) of the area of random nodes', 'm', 0.1, 1e5)
    depth_m: float = setting(100.0, 'depth (y) of this area', 'm', 0.1, 1e5)
    height_m: float = setting(1.5, 'height of the nodes of grid and random', 'm', -100.0, 1000.0)
    apart_m: float = setting(
        0.0, 'minimum distance of two random nodes; 0: half of the average distance', 'm', 0.0,
        1e4)
    time_unit: str = setting(
        's', 'unit of the times in @ lines of a links file', choices=('s', 'ms', 'us'))


@dataclass(frozen=True, slots=True)
class RadioSettings:
    """The radio and its propagation; the path loss is not used with a file of links."""

    mac: str | None = setting(
        None, 'back-off and acknowledgements as in TinyOS 1.x (tinyos1), TinyOS 2.x (tinyos2) or '
        'its simulator (tossim); default: tossim with a TOSSIM topology, else the version of '
        'TinyOS of the protocol', choices=PROFILES)
    acknowledge: str | None = setting(
        None, 'software (0.78 ms after the frame) or hardware (0.19 ms); default: that of the mac '
        'profile', choices=('hardware', 'software'))
    cut_off_frames: str = setting(
        'dropped', 'a frame whose reception ends because the node starts to send: dropped, as on '
        'a real CC2420, or kept in its receive FIFO, as on motes emulated by MSPSim; kept '
        'requires links and the mac tinyos2', choices=('dropped', 'kept'))
    power_dbm: float = setting(0.0, 'transmit power', 'dBm', -25.0, 20.0)
    noise: str = setting(
        'quiet', 'noise without a recording: quiet (a laboratory) or heavy (next to busy Wi-Fi)',
        choices=('quiet', 'heavy'))
    noise_file: str = setting(
        '', 'recorded noise: a line in dBm for each ms, may be compressed (.gz); overrides noise',
        is_file=True)
    noise_learned: int | None = setting(
        None, 'number of values at the start of noise_file used for the noise model; 0: all '
        '(default: all; 3000 with mac: tossim, the memory of TOSSIM)', minimum=0)
    loss_1m_db: float = setting(40.0, 'path loss over the first metre', 'dB', 0.0, 120.0)
    exponent: float = setting(2.4, 'path loss exponent', '', 1.0, 8.0)
    wall_db: float = setting(6.0, 'loss in each wall of the map', 'dB', 0.0, 60.0)
    shadowing_db: float = setting(
        4.0, 'standard deviation of the shadowing by furniture, for each pair of nodes', 'dB',
        0.0, 20.0)
    asymmetry_db: float = setting(
        1.5, 'standard deviation of the difference between the directions of a link', 'dB', 0.0,
        10.0)
    fading_db: float = setting(
        1.5, 'standard deviation of the fading over time', 'dB', 0.0, 20.0)
    fading_s: float = setting(30.0, 'correlation time of the fading', 's', 0.01, 1e5)


@dataclass(frozen=True, slots=True)
class SinkSettings:
    """The sink: a mote like the others, with a serial line instead of traffic."""

    id: int = setting(0, 'address of the sink', minimum=0, maximum=65533)  # noqa: A003
    place: tuple[float, ...] = setting(
        (), 'x, y and optionally height in m; default: the first corner of a grid, the middle of '
        'random nodes, the surveyed node with its id, else the start of its route')
    way: tuple[str, ...] = setting(
        (), 'way points of its route, driven in a loop: x y each, such as "3.0 1.5"; with '
        '"stay S" appended it waits there for S seconds')
    speed_m_s: float = setting(0.3, 'speed of the sink', 'm/s', 0.001, 50.0)
    start_s: float = setting(0.0, 'start time of its drive', 's', 0.0, 1e9)
    step_m: float = setting(
        0.1, 'the links are recomputed each time it has moved by this distance', 'm', 0.001, 100.0)


@dataclass(frozen=True, slots=True)
class TrafficSettings:
    """The packets of the application of each node."""

    period_ms: float | None = setting(
        None, 'time between two packets of a node', 'ms', 1.0, 1e9)
    period_binary_ms: float | None = setting(
        None, 'the same in 1/1024 s, as TinyOS counts (default 800 of these: 781.25 ms)',
        '1/1024 s', 1.0, 1e9)
    start_ms: float | None = setting(
        None, 'from boot to the first packet (default: random for each node, uniform up to one '
        'period, so that they do not all send at the same time)', 'ms', 0.0, 1e9)
    jitter_ms: float = setting(
        0.0, 'largest random delay of a packet, uniformly distributed', 'ms', 0.0, 1e9)
    payload: str | None = setting(
        None, 'surge (SurgeMsg), data (the DataMsg of the paper) or oscilloscope '
        '(MultihopOscilloscope); default: the usual one of the protocol', choices=PAYLOADS)
    sources: tuple[int, ...] = setting(
        (), 'ids of the nodes that send; empty: all except the sink', minimum=0, maximum=65533)


@dataclass(frozen=True, slots=True)
class EnergySettings:
    """The batteries, to estimate when the first is empty."""

    battery_mah: float = setting(2500.0, 'charge of a new battery', 'mAh', 0.001, 1e6)
    duty: float = setting(
        1.0, 'share of the time in which the radio listens when nothing is sent: 1 is always, '
        '0.03 is low-power listening; affects only the energy', '', 0.0, 1.0)
    wake_interval_s: float = setting(
        0.5, 'with low-power listening, time between two checks of the channel', 's', 0.001, 100.0)
    empty: bool = setting(False, 'switch off a node whose battery is empty')


@dataclass(frozen=True, slots=True)
class Scenario:
    """
    A whole scenario.

    The sections are no settings; the reader of the file handles them.
    """

    name: str = setting('', 'name in tables; default: the name of the file')
    seconds: float = setting(600.0, 'simulated time', 's', 0.001, 1e8)
    seed: int = setting(1, 'seed of all random numbers', minimum=0, maximum=2**53)
    protocol: str = setting('multihoplqi', 'routing protocol', choices=PROTOCOLS)
    tinyos: int | None = setting(
        None, 'version of TinyOS of multihoplqi (default 2); paper is based on 1, ctp on 2',
        choices=(1, 2))
    beacon_period_ms: float | None = setting(
        None, 'beacon period of multihoplqi and paper', 'ms', 10.0, 1e9)
    beacon_period_binary_ms: float | None = setting(
        None, 'the same in 1/1024 s (default: 32768, and 4096 of paper)', '1/1024 s', 10.0, 1e9)
    longest_interval_binary_ms: int | None = setting(
        None, 'longest time between two beacons of ctp (default: 512000, which is 500 s); 1024 '
        'for a moving sink', '1/1024 s', 256, 10**9)
    u16_wrap: bool | None = setting(
        None, 'link costs overflow at 16 bits as on a mote; default: true, false with mac: '
        'tossim, which runs on a PC')
    boot_s: float = setting(0.0, 'time at which the first node is switched on', 's', 0.0, 1e9)
    boot_spread_s: float | None = setting(
        None, 'each node is switched on later by a random time up to this, uniformly distributed '
        '(default: the period of the traffic; 1 s with mac: tossim)', 's', 0.0, 1e9)
    renew_m: float | None = setting(
        None, 'with paper and a moving sink: a round each time it has driven this distance, at '
        'most one a second, at least one a beacon period; default: one a beacon period',
        'm', 0.01, 1e4)
    drift_ppm: float | None = setting(
        None, 'standard deviation of the drift of the clocks (default: 20; 0 with mac: tossim, '
        'whose clocks do not drift)', 'ppm', 0.0, 1000.0)
    faults: tuple[str, ...] = setting(
        (), 'faults and events, in seconds: "kill 5 at 120", "reboot 5 at 120 for 3", "boot 5 at '
        '30", "sleep 5 at 100 for 60", "silence 5 at 100 for 60", "move 5 X Y at 100", "noise '
        '10 at 100 for 5"')
    topology: TopologySettings = field(default_factory=TopologySettings)
    radio: RadioSettings = field(default_factory=RadioSettings)
    sink: SinkSettings = field(default_factory=SinkSettings)
    traffic: TrafficSettings = field(default_factory=TrafficSettings)
    energy: EnergySettings = field(default_factory=EnergySettings)

    @property
    def period_ns(self) -> int:
        """Return the time between two packets of a node, on its clock."""
        return _ns(self.traffic.period_ms, self.traffic.period_binary_ms, 800.0)

    @property
    def beacon_period_ns(self) -> int:
        """Return the time between two beacons, on the clock of the sender."""
        default = 4096.0 if self.protocol == 'paper' else 32768.0
        return _ns(self.beacon_period_ms, self.beacon_period_binary_ms, default)

    @property
    def start_ns(self) -> int | None:
        """Return the time from boot to the first packet; None: random."""
        start_ms = self.traffic.start_ms
        return None if start_ms is None else round(start_ms * NS_PER_MS)


#: The sections of a scenario, and the settings in them.
SECTIONS: Final[dict[str, type]] = {
    'topology': TopologySettings, 'radio': RadioSettings, 'sink': SinkSettings,
    'traffic': TrafficSettings, 'energy': EnergySettings}


def _ns(ms: float | None, binary_ms: float | None, default_binary_ms: float) -> int:
    if ms is not None:
        return round(ms * NS_PER_MS)
    return round((default_binary_ms if binary_ms is None else binary_ms) * BINARY_MS_NS)


def settled(scenario: Scenario) -> Scenario:
    """Return the scenario with all defaults set."""
    tinyos = scenario.tinyos or (1 if scenario.protocol == 'paper' else 2)
    mac = scenario.radio.mac or ('tossim' if scenario.topology.tossim else f'tinyos{tinyos}')
    payload = scenario.traffic.payload or (
        'data' if scenario.protocol == 'paper' else 'surge' if tinyos == 1 else 'oscilloscope')
    acknowledge = scenario.radio.acknowledge or (
        'software' if mac == 'tinyos2' else 'hardware')
    wrap = mac != 'tossim' if scenario.u16_wrap is None else scenario.u16_wrap
    drift_ppm = scenario.drift_ppm
    if drift_ppm is None:
        drift_ppm = 0.0 if mac == 'tossim' else _USUAL_DRIFT_PPM
    spread_s = scenario.boot_spread_s
    if spread_s is None:
        spread_s = 1.0 if mac == 'tossim' else scenario.period_ns / NS_PER_S
    return replace(
        scenario, tinyos=tinyos, u16_wrap=wrap, drift_ppm=drift_ppm, boot_spread_s=spread_s,
        radio=replace(scenario.radio, mac=mac, acknowledge=acknowledge),
        traffic=replace(scenario.traffic, payload=payload))


def wrong(scenario: Scenario) -> Iterator[Wrong]:
    """Find contradictions between settings whose values are valid by themselves."""
    yield from _wrong_topology(scenario.topology, scenario.sink)
    if scenario.tinyos is not None and scenario.protocol != 'multihoplqi':
        one = 1 if scenario.protocol == 'paper' else 2
        if scenario.tinyos != one:
            yield 'tinyos', f'must be {one}, or left out: {scenario.protocol} has no other'
    if scenario.protocol == 'ctp':
        for key in ('beacon_period_ms', 'beacon_period_binary_ms'):
            if getattr(scenario, key) is not None:
                yield key, 'must be left out: the beacon period of ctp is adaptive'
    elif scenario.longest_interval_binary_ms is not None:
        yield 'longest_interval_binary_ms', 'must be left out: only ctp has it'
    if scenario.renew_m is not None and (scenario.protocol != 'paper' or not scenario.sink.way):
        yield 'renew_m', 'must be left out: it requires protocol: paper and a route of the sink'
    for owner, prefix, key in ((scenario, '', 'beacon_period'),
                               (scenario.traffic, 'traffic.', 'period')):
        if None not in (getattr(owner, f'{key}_ms'), getattr(owner, f'{key}_binary_ms')):
            yield f'{prefix}{key}_ms', f'must be left out: {key}_binary_ms is given as well'
    if scenario.radio.cut_off_frames == 'kept':
        if not scenario.topology.links or settled(scenario).radio.mac != 'tinyos2':
            yield 'radio.cut_off_frames', 'must be dropped: kept needs links and the mac tinyos2'
    tinyos = settled(scenario).tinyos
    if scenario.protocol == 'multihoplqi' and tinyos == 1 and scenario.sink.id:
        yield 'sink.id', 'must be 0: in TinyOS 1.x the base station is node 0'
    if scenario.protocol == 'paper' and scenario.sink.id:
        yield 'sink.id', 'must be 0: in TinyOS 1.x the base station is node 0'


_KINDS: Final = ('grid', 'random', 'nodes', 'nodes_file', 'links', 'tossim')


def _wrong_topology(topology: TopologySettings, sink: SinkSettings) -> Iterator[Wrong]:
    kinds = [key for key in _KINDS if getattr(topology, key)]
    if not kinds:
        yield 'topology', f'must have one of {", ".join(_KINDS)}, such as grid: 4x5'
    for key in kinds[1:]:
        yield f'topology.{key}', f'must be left out: {kinds[0]} already defines the nodes'
    if kinds and kinds[0] in ('links', 'tossim'):
        unplaced: tuple[tuple[Any, str, str], ...] = (
            (topology.map, 'topology.map', 'the file defines the links'),
            (sink.way, 'sink.way', 'the links are from a file, and nodes have no position; write '
             '@ lines into a links file'))
        for value, key, why in unplaced:
            if value:
                yield key, f'must be left out: {why}'
    if len(sink.place) not in (0, 2, 3):
        yield 'sink.place', 'must be x, y or x, y, height'
