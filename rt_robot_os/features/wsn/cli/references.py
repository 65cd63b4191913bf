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
Reference results of TOSSIM and of real firmware, from a folder.

``tossim_reference.json`` is a list of runs: ``variant`` (``lqi32``: MultiHopLQI with beacons each
32 s; ``ctp``), ``topology`` (of ``tossim_NAME.topo.txt``), ``noise`` (of ``noise_NAME.txt.gz``),
``seed``, ``seconds``, ``generated``, ``delivered``, ``transmissions``. ``mspsim_summary.json``
has, by ``NAME_PROTOCOL``, results of real firmware on emulated motes with the links of
``mspsim_NAME.links.txt``; the log of the air ``mspsim_NAME_PROTOCOL.air.csv.gz`` has the start
times of the motes, their parents and their beacons.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
import csv
from dataclasses import dataclass
from dataclasses import field
from functools import partial
import gzip
import json
import math
from pathlib import Path
import re
import statistics
from typing import Any
from typing import Final
from typing import NamedTuple
import zlib

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.packets.ieee802154 import read_frame
from rt_robot_os.features.wsn.packets.ieee802154 import T2Frame
from rt_robot_os.features.wsn.radio.noise import read_trace
from rt_robot_os.features.wsn.routing.protocol import BINARY_MS_NS
from rt_robot_os.features.wsn.simulator.link_files import read_links
from rt_robot_os.features.wsn.simulator.scenario import RadioSettings
from rt_robot_os.features.wsn.simulator.scenario import Scenario
from rt_robot_os.features.wsn.simulator.scenario import settled
from rt_robot_os.features.wsn.simulator.scenario import TopologySettings
from rt_robot_os.features.wsn.simulator.scenario import TrafficSettings

TOSSIM_FILE: Final = 'tossim_reference.json'
FIRMWARE_FILE: Final = 'mspsim_summary.json'

_FRAMES_WITHIN: Final = 0.15
_QUIET_WITHIN, _HEAVY_WITHIN, _FIRMWARE_WITHIN = 0.03, 0.06, 0.03
_LOUD_DBM, _LOUD_SHARE = -85, 0.02
_TOSSIM_PERIOD_BINARY_MS: Final = 800.0
_TOSSIM_PERIOD_NS: Final = round(_TOSSIM_PERIOD_BINARY_MS * BINARY_MS_NS)
# TOSSIM's motes boot within a ms, as in TinyOS' own scripts, or within a second.
_TOGETHER_S: Final = 0.001
_WITHIN_S: Final = 1.0
_READINGS: Final = 5
_FIRST_TICKS: Final = 6
_LQI_DATA, _CTP_DATA, _LQI_BEACON = 0x74, 0x71, 0x73
_BROADCAST: Final = 0xFFFF


# Exceptions of parsing malformed files.
_MALFORMED: Final = (
    ArithmeticError, AttributeError, EOFError, KeyError, TypeError, ValueError, zlib.error)


@dataclass(frozen=True)
class Reference:
    """
    One network with its reference result.

    :ivar scenarios: of our simulation, one for each seed.
    :ivar delivery: of the reference, the mean over the seeds.
    :ivar delivery_within: largest difference of ours.
    :ivar frames_per_delivery: of the reference; None when it is not compared.
    :ivar beacons_count: these frames include beacons.
    :ivar single: the reference is a single run.
    :ivar parents: final parents of the reference; empty when unknown.
    :ivar beacon_costs: all costs that beacons of the reference advertised.
    """

    name: str
    scenarios: Sequence[Scenario]
    delivery: float
    delivery_within: float
    frames_per_delivery: float | None = None
    frames_within: float = _FRAMES_WITHIN
    beacons_count: bool = True
    single: bool = False
    parents: Mapping[int, int] = field(default_factory=dict)
    beacon_costs: Mapping[int, frozenset[int]] = field(default_factory=dict)


#: The name of a reference, and its reader.
Make = tuple[str, Callable[[], Reference]]


class Skipped(NamedTuple):
    """A reference that cannot be compared, and why."""

    name: str
    why: str


def read_references(folder: Path, seeds: int = 6) -> tuple[list[Reference], list[Skipped]]:
    """
    Read all references of a folder.

    :param seeds: number of our runs against the single firmware run.
    :return: those that can be compared, and those with a missing or malformed file.
    """
    found: list[Reference] = []
    skipped: list[Skipped] = []
    readers: Sequence[tuple[str, Callable[[Any], Iterator[Make]]]] = (
        (TOSSIM_FILE, partial(_tossim, folder)),
        (FIRMWARE_FILE, partial(_firmware, folder, seeds)))
    for name, makes in readers:
        path = folder / name
        if not path.is_file():
            continue
        try:
            for label, make in makes(json.loads(path.read_text())):
                why = _problem(folder, make, found)
                if why:
                    skipped.append(Skipped(label, why))
        except (OSError, *_MALFORMED) as error:
            skipped.append(Skipped(name, _reason(path, error)))
    return found, skipped


def _problem(folder: Path, make: Callable[[], Reference], found: list[Reference]) -> str:
    try:
        found.append(make())
    except ConfigError as error:
        return '; '.join(error.problems)
    except (OSError, *_MALFORMED) as error:
        return _reason(folder, error)
    return ''


def _reason(path: Path, error: Exception) -> str:
    if isinstance(error, (OSError, EOFError, zlib.error)):
        name = getattr(error, 'filename', None) or path
        return f'{name}: cannot be read: {getattr(error, "strerror", None) or error}'
    return f'{path}: malformed: {error!r}'


def _tossim(folder: Path, rows: Sequence[Mapping[str, Any]]) -> Iterator[Make]:
    groups: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row['topology'], row['noise'], row['variant']), []).append(row)
    boot_spread_s = _boot_spread_s(rows)
    for key, runs in groups.items():
        label = ' '.join(('TOSSIM', *map(str, key)))
        yield label, partial(_tossim_reference, folder, label, *key, runs, boot_spread_s)


def _tossim_reference(folder: Path, label: str, topology: str, noise: str, variant: str,
                      runs: Sequence[Mapping[str, Any]], boot_spread_s: float) -> Reference:
    trace = _file_in(folder, f'noise_{noise}.txt')
    return Reference(
        label,
        [tossim_scenario(_file_in(folder, f'tossim_{topology}.topo.txt'), trace, variant,
                         float(run['seconds']), int(run['seed']), boot_spread_s)
         for run in runs],
        statistics.fmean(run['delivered'] / run['generated'] for run in runs),
        _HEAVY_WITHIN if _is_heavy(trace) else _QUIET_WITHIN,
        statistics.fmean(run['transmissions'] / run['delivered'] for run in runs))


def _boot_spread_s(rows: Sequence[Mapping[str, Any]]) -> float:
    """
    Return the time within which the motes of all runs of a file booted.

    The first packet of a mote is one period after its boot. Motes that boot together generate the
    same number of packets; of motes that boot within a second, a fifth generate one less.
    """
    for run in rows:
        try:
            most = math.ceil(float(run['seconds']) * NS_PER_S / _TOSSIM_PERIOD_NS) - 1
            if int(run['generated']) % most:
                return _WITHIN_S
        except _MALFORMED:
            # Such a run is skipped later, with the reason.
            continue
    return _TOGETHER_S


def _file_in(folder: Path, name: str) -> str:
    for path in (folder / name, folder / f'{name}.gz'):
        if path.is_file():
            return str(path)
    raise ConfigError([f'{folder / name}: no such file, gzipped (.gz) or not'])


def _is_heavy(trace: str) -> bool:
    values = read_trace(trace)
    return sum(value > _LOUD_DBM for value in values) > _LOUD_SHARE * len(values)


def tossim_scenario(topology: str, noise: str, variant: str, seconds: float = 600.0,
                    seed: int = 1, boot_spread_s: float = _WITHIN_S) -> Scenario:
    """
    Return the scenario of a TOSSIM run: data every 800 binary ms, the first a period after boot.

    In a dense network the boot times matter: motes that boot together also send together, because
    TOSSIM's clocks do not drift.

    :param variant: ``ctp`` or ``lqiN`` with beacons each N s.
    :raises ValueError: it is neither.
    """
    match = re.fullmatch(r'lqi(\d+)', variant)
    if match is None and variant != 'ctp':
        raise ValueError(f'variant {variant!r}: must be ctp or such as lqi32')
    return settled(Scenario(
        name=Path(topology).name, seconds=seconds, seed=seed, boot_spread_s=boot_spread_s,
        protocol='ctp' if match is None else 'multihoplqi', tinyos=2,
        beacon_period_binary_ms=None if match is None else 1024.0 * int(match[1]),
        topology=TopologySettings(tossim=topology),
        radio=RadioSettings(mac='tossim', noise_file=noise),
        traffic=TrafficSettings(period_binary_ms=_TOSSIM_PERIOD_BINARY_MS,
                                start_ms=_TOSSIM_PERIOD_NS / NS_PER_MS)))


# ---- firmware -------------------------------------------------------------------------------


@dataclass
class _Air:
    """The content of a log of the air."""

    first_us: dict[int, int] = field(default_factory=dict)
    parents: dict[int, int] = field(default_factory=dict)
    costs: dict[int, set[int]] = field(default_factory=dict)
    interval: int = 1024


def _firmware(folder: Path, seeds: int, summary: Mapping[str, Mapping[str, Any]]
              ) -> Iterator[Make]:
    for name, one in summary.items():
        network, _, protocol = name.rpartition('_')
        label = f'firmware {network} {protocol}'
        yield label, partial(
            _firmware_reference, folder, label, network, protocol, one, seeds)


def _firmware_reference(folder: Path, label: str, network: str, protocol: str,
                        one: Mapping[str, Any], seeds: int) -> Reference:
    links = _file_in(folder, f'mspsim_{network}.links.txt')
    air = _air(_file_in(folder, f'mspsim_{network}_{protocol}.air.csv'))
    generated, delivered = (sum(one[key].values()) for key in ('generated', 'delivered'))
    most = max(one['generated'].values())
    return Reference(
        label,
        [_firmware_scenario(links, protocol, air, most, seed + 1) for seed in range(seeds)],
        delivered / generated, _FIRMWARE_WITHIN, one.get('transmissions_per_delivery'),
        beacons_count=False, single=True, parents=air.parents,
        beacon_costs={node: frozenset(costs) for node, costs in air.costs.items()})


def _air(path: str) -> _Air:
    air = _Air()
    with gzip.open(path, 'rt') if path.endswith('.gz') else open(path) as file:
        for row in csv.DictReader(file):
            frame = read_frame(bytes.fromhex(row['mpdu_hex_with_length_byte']))
            if not isinstance(frame, T2Frame):
                continue
            node, data = frame.source, frame.payload
            if frame.am_type == _LQI_BEACON:
                air.costs.setdefault(node, set()).add(int.from_bytes(data[8:10], 'big'))
            elif frame.am_type in (_LQI_DATA, _CTP_DATA):
                if frame.destination != _BROADCAST:
                    air.parents[node] = frame.destination
                skipped, origin = (9, 0) if frame.am_type == _LQI_DATA else (8, 4)
                air.interval = int.from_bytes(data[skipped + 2:skipped + 4], 'big') or 1024
                # A forwarded packet does not show the boot time of the node.
                if int.from_bytes(data[origin:origin + 2], 'big') == node:
                    air.first_us.setdefault(node, int(row['t_us']))
    return air


def _firmware_scenario(links: str, protocol: str, air: _Air, packets: int, seed: int) -> Scenario:
    """Return the scenario of motes with MultihopOscilloscope: six readings, then a packet."""
    interval_s = air.interval / 1024
    first_s = min(air.first_us.values()) / 1e6
    boots_s = {node: max(0.0, first_us / 1e6 - _FIRST_TICKS * interval_s)
               for node, first_us in air.first_us.items()}
    # It ends half a period after the last packet, rounded up to 10 s.
    end_s = 10.0 * math.ceil((first_s + interval_s * _READINGS * (packets - 0.5)) / 10.0)
    return settled(Scenario(
        name=Path(links).name, seconds=end_s, seed=seed, protocol=protocol, tinyos=2,
        boot_s=min(boots_s.values()), boot_spread_s=0.0,
        drift_ppm=0.0,
        faults=tuple(f'boot {node} at {boot_s:.6f}' for node, boot_s in boots_s.items()),
        topology=TopologySettings(links=links, time_unit=_time_unit(links, end_s)),
        radio=RadioSettings(mac='tinyos2'),
        traffic=TrafficSettings(period_binary_ms=float(air.interval * _READINGS),
                                start_ms=1000.0 * _FIRST_TICKS * interval_s)))


def _time_unit(links: str, end_s: float) -> str:
    """Guess the time unit of a links file: its changes must precede the end."""
    for unit in ('s', 'ms'):
        changes = read_links(links, unit)[1]
        if not changes or changes[0].at_ns <= end_s * NS_PER_S:
            return unit
    return 'us'
