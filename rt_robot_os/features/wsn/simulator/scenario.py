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
What is simulated: the settings of a scenario, checked as a whole.

The YAML file is read elsewhere; this is what it says. Units are in the names; ``None`` leaves a
choice to the rest of the scenario, and :func:`settled` makes it.
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
#: Addresses have 16 bits, of which two are no node's; more nodes are several networks.
MOST_NODES_A_PAN: Final = 65_534
_USUAL_DRIFT_PPM: Final = 20.0

#: Found wrong: the dotted key, and what would be right.
Wrong = tuple[str, str]


@dataclass(frozen=True, slots=True)
class TopologySettings:
    """Where the nodes are, or how they hear each other: exactly one of the first six keys."""

    grid: str = setting(
        '', 'rows x columns of a grid, such as 4x5; ids count from 0 along the rows')
    random: int = setting(
        0, 'so many nodes anywhere in an area, or in the free places of the map',
        minimum=0, maximum=MOST_NODES)
    nodes: tuple[str, ...] = setting(
        (), 'surveyed nodes: name x y height [id N] [quantity ...], such as "hall 3.0 1.5 2.2"')
    nodes_file: str = setting(
        '', 'a YAML file with such a list under nodes:, such as the file of a world',
        is_file=True)
    links: str = setting(
        '', 'a file with a line "from to prr rssi lqi" for each link', is_file=True)
    tossim: str = setting(
        '', 'a file with a line "gain from to dB" for each link, as TOSSIM reads it',
        is_file=True)
    map: str = setting(  # noqa: A003
        '', 'a ROS map, whose walls weaken what goes through; with grid, random or nodes',
        is_file=True)
    spacing_m: float = setting(30.0, 'between neighbours of the grid', 'm', 0.01, 1e4)
    jitter_m: float = setting(
        0.0, 'standard deviation by which each node of the grid is off its place', 'm', 0.0, 1e4)
    width_m: float = setting(100.0, 'of the area of random nodes', 'm', 0.1, 1e5)
    depth_m: float = setting(100.0, 'of the same, along y', 'm', 0.1, 1e5)
    height_m: float = setting(1.5, 'of the nodes of grid and random', 'm', -100.0, 1000.0)
    apart_m: float = setting(
        0.0, 'least distance of two random nodes; 0: half of what is there on average', 'm', 0.0,
        1e4)
    time_unit: str = setting(
        's', 'in which a links file counts the time of its @ lines', choices=('s', 'ms', 'us'))


@dataclass(frozen=True, slots=True)
class RadioSettings:
    """The radio, and the air; the path is of no concern where a file has the links."""

    mac: str | None = setting(
        None, 'whose back-off and acknowledgements: tinyos1 for TinyOS 1.x, tinyos2 for 2.x, '
        'tossim for its simulator; when absent, tossim with a TOSSIM topology, else what the '
        'protocol runs under', choices=PROFILES)
    acknowledge: str | None = setting(
        None, 'software (0.78 ms after the frame) or hardware (0.19 ms); when absent as the mac '
        'profile has it', choices=('hardware', 'software'))
    cut_off_frames: str = setting(
        'dropped', 'a frame whose reception ends because the node begins to send: dropped, as on '
        'a real CC2420, or kept in its receive FIFO, as on motes that MSPSim emulates; kept needs '
        'links and the mac tinyos2', choices=('dropped', 'kept'))
    power_dbm: float = setting(0.0, 'of the transmitter', 'dBm', -25.0, 20.0)
    noise: str = setting(
        'quiet', 'noise of no recording: quiet (a laboratory) or heavy (beside busy Wi-Fi)',
        choices=('quiet', 'heavy'))
    noise_file: str = setting(
        '', 'recorded noise: dBm, a line each ms, also packed (.gz); wins over noise',
        is_file=True)
    noise_learned: int | None = setting(
        None, 'so many values at the beginning of noise_file are learned from; 0 is all (default: '
        'all; 3000 with mac: tossim, as TOSSIM has memory for)', minimum=0)
    loss_1m_db: float = setting(40.0, 'path loss over the first metre', 'dB', 0.0, 120.0)
    exponent: float = setting(2.4, 'of the path loss', '', 1.0, 8.0)
    wall_db: float = setting(6.0, 'loss in each wall of the map', 'dB', 0.0, 60.0)
    shadowing_db: float = setting(
        4.0, 'standard deviation of what furniture adds or takes, of each pair of nodes', 'dB',
        0.0, 20.0)
    asymmetry_db: float = setting(
        1.5, 'standard deviation by which the two ways of a link differ', 'dB', 0.0, 10.0)
    fading_db: float = setting(
        1.5, 'standard deviation of what changes in time', 'dB', 0.0, 20.0)
    fading_s: float = setting(30.0, 'how long such a change lasts', 's', 0.01, 1e5)


@dataclass(frozen=True, slots=True)
class SinkSettings:
    """The sink: a mote like the others, with a serial line instead of traffic."""

    id: int = setting(0, 'its address', minimum=0, maximum=65533)  # noqa: A003
    place: tuple[float, ...] = setting(
        (), 'x, y and, if you like, height in m; when absent a grid has it in its first corner, '
        'random nodes in the middle, surveyed ones where the node of its id is, else its way '
        'begins')
    way: tuple[str, ...] = setting(
        (), 'way points on which it drives round and round: x y each, such as "3.0 1.5"; with '
        '"stay S" behind it waits there for S seconds')
    speed_m_s: float = setting(0.3, 'at which it drives', 'm/s', 0.001, 50.0)
    start_s: float = setting(0.0, 'when it begins to drive', 's', 0.0, 1e9)
    step_m: float = setting(
        0.1, 'the links are computed anew each time it has moved so far', 'm', 0.001, 100.0)


@dataclass(frozen=True, slots=True)
class TrafficSettings:
    """What the application of each node sends."""

    period_ms: float | None = setting(
        None, 'time between two packets of a node', 'ms', 1.0, 1e9)
    period_binary_ms: float | None = setting(
        None, 'the same in 1/1024 s, as TinyOS counts (default 800 of these: 781.25 ms)',
        '1/1024 s', 1.0, 1e9)
    start_ms: float | None = setting(
        None, 'from boot to the first packet (default: drawn for each node, evenly, up to one '
        'period, so that they do not all send at once)', 'ms', 0.0, 1e9)
    jitter_ms: float = setting(
        0.0, 'each packet is late by up to this, drawn evenly', 'ms', 0.0, 1e9)
    payload: str | None = setting(
        None, 'surge (SurgeMsg), data (the DataMsg of the paper) or oscilloscope '
        '(MultihopOscilloscope); when absent what is usual with the protocol', choices=PAYLOADS)
    sources: tuple[int, ...] = setting(
        (), 'ids of the nodes that send; empty: all but the sink', minimum=0, maximum=65533)


@dataclass(frozen=True, slots=True)
class EnergySettings:
    """What the batteries hold, to tell when the first is empty."""

    battery_mah: float = setting(2500.0, 'charge of a new battery', 'mAh', 0.001, 1e6)
    duty: float = setting(
        1.0, 'share of the time in which the radio listens when nothing is sent: 1 is always, '
        '0.03 low-power listening; counts for the energy alone', '', 0.0, 1.0)
    wake_interval_s: float = setting(
        0.5, 'with low-power listening the time between two looks at the channel', 's', 0.001,
        100.0)
    empty: bool = setting(False, 'a node whose battery is empty is dead')


@dataclass(frozen=True, slots=True)
class Scenario:
    """
    A whole scenario.

    The sections are not settings of their own: the reader of the file knows them.
    """

    name: str = setting('', 'what tables call it; when absent the name of the file')
    seconds: float = setting(600.0, 'simulated time', 's', 0.001, 1e8)
    seed: int = setting(1, 'of all chance', minimum=0, maximum=2**53)
    protocol: str = setting('multihoplqi', 'routing', choices=PROTOCOLS)
    tinyos: int | None = setting(
        None, 'version of TinyOS whose MultiHopLQI it is (default 2); the paper is built on 1, '
        'ctp on 2', choices=(1, 2))
    beacon_period_ms: float | None = setting(
        None, 'of multihoplqi and paper', 'ms', 10.0, 1e9)
    beacon_period_binary_ms: float | None = setting(
        None, 'the same in 1/1024 s (default: 32768, and 4096 of paper)', '1/1024 s', 10.0, 1e9)
    longest_interval_binary_ms: int | None = setting(
        None, 'between two beacons of ctp while all is well (default: 512000, which is 500 s); '
        '1024 for a sink that moves', '1/1024 s', 256, 10**9)
    u16_wrap: bool | None = setting(
        None, 'link costs overflow as in 16 bits of a mote; when absent: yes, but with mac: '
        'tossim, which runs on a PC')
    boot_s: float = setting(0.0, 'when the first node is switched on', 's', 0.0, 1e9)
    boot_spread_s: float | None = setting(
        None, 'each node is switched on so much later at most, drawn evenly (default: the period '
        'of the traffic, so that not all send at once; 1 s with mac: tossim)', 's', 0.0, 1e9)
    renew_m: float | None = setting(
        None, 'of paper with a sink that drives: a round for each so many metres of its way, not '
        'under 1 s apart, and not above the beacon period; when absent the period alone counts',
        'm', 0.01, 1e4)
    drift_ppm: float | None = setting(
        None, 'standard deviation of the error of the clocks (default: 20; 0 with mac: tossim, '
        'whose clocks are all right)', 'ppm', 0.0, 1000.0)
    faults: tuple[str, ...] = setting(
        (), 'what happens, in seconds: "kill 5 at 120", "reboot 5 at 120 for 3", "boot 5 at 30", '
        '"sleep 5 at 100 for 60", "silence 5 at 100 for 60", "move 5 X Y at 100", "noise 10 at '
        '100 for 5"')
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
        """Return the time between two beacons, on the clock of who sends them."""
        default = 4096.0 if self.protocol == 'paper' else 32768.0
        return _ns(self.beacon_period_ms, self.beacon_period_binary_ms, default)

    @property
    def start_ns(self) -> int | None:
        """Return the time from boot to the first packet; None where it is drawn."""
        start_ms = self.traffic.start_ms
        return None if start_ms is None else round(start_ms * NS_PER_MS)


#: The sections of a scenario and what is in them.
SECTIONS: Final[dict[str, type]] = {
    'topology': TopologySettings, 'radio': RadioSettings, 'sink': SinkSettings,
    'traffic': TrafficSettings, 'energy': EnergySettings}


def _ns(ms: float | None, binary_ms: float | None, default_binary_ms: float) -> int:
    if ms is not None:
        return round(ms * NS_PER_MS)
    return round((default_binary_ms if binary_ms is None else binary_ms) * BINARY_MS_NS)


def settled(scenario: Scenario) -> Scenario:
    """Return the scenario with the choices made that it leaves open."""
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
    """Find what contradicts itself, though each value by itself may be used."""
    yield from _wrong_topology(scenario.topology, scenario.sink)
    if scenario.tinyos is not None and scenario.protocol != 'multihoplqi':
        one = 1 if scenario.protocol == 'paper' else 2
        if scenario.tinyos != one:
            yield 'tinyos', f'must be {one}, or left out: {scenario.protocol} has no other'
    if scenario.protocol == 'ctp':
        for key in ('beacon_period_ms', 'beacon_period_binary_ms'):
            if getattr(scenario, key) is not None:
                yield key, 'must be left out: ctp times its beacons itself'
    elif scenario.longest_interval_binary_ms is not None:
        yield 'longest_interval_binary_ms', 'must be left out: only ctp has it'
    if scenario.renew_m is not None and (scenario.protocol != 'paper' or not scenario.sink.way):
        yield 'renew_m', 'must be left out: it is for protocol: paper and a sink with a way'
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
        yield f'topology.{key}', f'must be left out: {kinds[0]} says already which nodes there are'
    if kinds and kinds[0] in ('links', 'tossim'):
        unplaced: tuple[tuple[Any, str, str], ...] = (
            (topology.map, 'topology.map', 'the file has the links themselves'),
            (sink.way, 'sink.way', 'the links come from a file, and no node has a place; write '
             '@ lines into a links file'))
        for value, key, why in unplaced:
            if value:
                yield key, f'must be left out: {why}'
    if len(sink.place) not in (0, 2, 3):
        yield 'sink.place', 'must be x, y or x, y, height'
