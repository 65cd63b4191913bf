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
The comparison as tables: ``./scripts/bench attitude_comparison --help``.

The filters of other packages are left out, with a word, where those are not installed.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version
from pathlib import Path
import platform
import statistics
import sys
import time
from typing import Final

from benchmarks.attitude_comparison import known
from benchmarks.attitude_comparison import recordings
from benchmarks.attitude_comparison.errors import Errors
from benchmarks.attitude_comparison.errors import errors_of
from benchmarks.attitude_comparison.errors import products
from benchmarks.attitude_comparison.peers import Peer
from benchmarks.attitude_comparison.peers import PEERS
from benchmarks.attitude_comparison.recordings import Array
from benchmarks.attitude_comparison.recordings import Recording
import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import no_match

_COST_SAMPLES: Final = 2000


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables, in Markdown."""
    parser = _parser()
    wanted = parser.parse_args(arguments)
    if not (wanted.job or wanted.xio or wanted.broad):
        parser.error('nothing to compare: give --xio FILE, --broad FOLDER or --job')
    if not any(wanted.only in peer.name for peer in PEERS):
        print(f'attitude: {no_match("--only", wanted.only, (peer.name for peer in PEERS))}',
              file=sys.stderr)
        return 2
    peers = [peer for peer in PEERS if wanted.only in peer.name and _installed(peer)]
    if not peers:
        return 2  # none of those that were chosen is installed, as was said
    _print_conditions(peers)
    try:
        if wanted.job:
            _print_job(peers, wanted.runs)
        if wanted.xio:
            _print_xio(recordings.xio(wanted.xio), peers, wanted.runs)
        if wanted.broad:
            _print_broad(recordings.broad_files(wanted.broad), peers)
    except (ConfigError, OSError) as error:
        print(f'attitude: {error}', file=sys.stderr)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='attitude_comparison',
        description='Compare attitude filters on recordings; prints tables in Markdown.')
    parser.add_argument('--xio', type=Path, metavar='FILE',
                        help='the recording xio_sensor_data.csv of x-io Technologies')
    parser.add_argument('--broad', type=Path, metavar='FOLDER',
                        help='trials of BROAD (github.com/dlaidig/broad), .hdf5 or .mat')
    parser.add_argument('--job', action='store_true',
                        help='measure what a job of the module costs')
    parser.add_argument('--only', default='', metavar='TEXT', help='filters with this in the name')
    parser.add_argument('--runs', type=int, default=7, help='runs to measure the cost (7)')
    return parser


def _installed(peer: Peer) -> bool:
    try:
        if peer.package:
            version(peer.package)
    except PackageNotFoundError:
        print(f'attitude: {peer.name} ({peer.axes} axes) is left out: python3 -m pip install '
              f'{peer.package}', file=sys.stderr)
        return False
    return True


def _print_conditions(peers: Iterable[Peer]) -> None:
    packages = sorted({peer.package for peer in peers if peer.package} | {'numpy'})
    names = ', '.join(f'{name} {version(name)}' for name in packages)
    print(f'Python {platform.python_version()}, {names}, {platform.machine()}.\n')


def _print_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    print(f'| {" | ".join(head)} |')
    print(f'|---|{"--:|" * (len(head) - 1)}')
    for row in rows:
        print(f'| {" | ".join(row)} |', flush=True)
    print()


def _name(peer: Peer) -> str:
    return f'{peer.name}, {peer.axes} axes'


def _print_job(peers: Iterable[Peer], runs: int) -> None:
    # Only here: it needs the message packages of ROS 2, and the rest does not.
    from benchmarks.attitude_comparison.step_cost import costs
    known_names = {peer.name for peer in peers}
    names = tuple(name for name in ('mahony', 'vqf') if name in known_names)
    if not names:
        raise ConfigError(['--job measures mahony and vqf: leave --only away'])
    found = costs(names, runs)
    print(f'CPU time of a job with a new sample: microseconds, median and range of {runs} runs.\n')
    _print_table(('module', 'median', 'runs', 'times the copy'), (
        (cost.name, f'{cost.median:.1f}', f'{cost.lowest:.1f} to {cost.highest:.1f}',
         f'{cost.median / found[0].median:.1f}') for cost in found))


# ---- the recording of x-io ------------------------------------------------------------------


def _print_xio(recording: Recording, peers: Iterable[Peer], runs: int) -> None:
    print('Degrees; CPU time a sample in microseconds, median and range of the runs:\n')
    _print_table(
        ('filter', 'heading at rest', 'inclination at rest', 'tilt while spun',
         'heading moved by the magnet', 'cost', 'cost of the runs'),
        ((_name(peer), *_xio_cells(recording, peer, runs)) for peer in peers))


def _xio_cells(recording: Recording, peer: Peer, runs: int) -> tuple[str, ...]:
    found = known.find(recording, peer.run(recording), peer.axes)
    costs = sorted(_cost_us(recording, peer) for _ in range(runs))
    values = (found.heading, found.inclination, found.spun, found.magnet)
    return (*(f'{value:.1f}' for value in values), f'{statistics.median(costs):.1f}',
            f'{costs[0]:.1f} to {costs[-1]:.1f}')


def _cost_us(recording: Recording, peer: Peer) -> float:
    """Measure a stretch in which the sensor moves: the whole run with its loop."""
    rows = slice(1500, 1500 + _COST_SAMPLES)
    part = Recording(recording.name, recording.time_s[rows], recording.rate[rows],
                     recording.acceleration[rows], recording.field[rows], None,
                     recording.counted[rows])
    begin_ns = time.thread_time_ns()
    peer.run(part)
    return (time.thread_time_ns() - begin_ns) / 1000 / _COST_SAMPLES


# ---- BROAD ----------------------------------------------------------------------------------


def _print_broad(files: Sequence[Path], peers: Sequence[Peer]) -> None:
    if not files:
        raise ConfigError(['no trial of BROAD there: a folder with files such as '
                           '01_undisturbed_slow_rotation_A.hdf5 is wanted'])
    found: dict[str, list[Errors]] = {_name(peer): [] for peer in peers}
    names = []
    for file in files:
        recording = recordings.broad(file)
        names.append(recording.name)
        for peer in peers:
            found[_name(peer)].append(_broad_errors(recording, peer))
        print(f'{recording.name}', file=sys.stderr, flush=True)
    print(f'{len(files)} trials; mean of the root mean squares in degrees, and the worst trial:\n')
    _print_table(('filter', 'total', 'heading', 'inclination', 'worst total', 'worst inclination'),
                 ((name, *_broad_cells(errors)) for name, errors in found.items()))
    print('Total of each trial with 9 axes:\n')
    nine = [_name(peer) for peer in peers if peer.axes == 9]
    _print_table(('trial', *(name.removesuffix(', 9 axes') for name in nine)),
                 ((name, *(f'{found[peer][row].total:.1f}' for peer in nine))
                  for row, name in enumerate(names)))


def _broad_errors(recording: Recording, peer: Peer) -> Errors:
    reference = recording.reference
    if reference is None:
        raise ConfigError([f'{recording.name} has no reference'])
    turned = _in_the_same_world(peer.run(recording), recording, reference, peer.axes)
    return errors_of(turned, reference, recording.counted)


def _in_the_same_world(
    turned: Array, recording: Recording, reference: Array, axes: int,
) -> Array:
    """
    Turn an estimate about the vertical, by quarters, to east, north, up.

    Without magnetometer, turn it as the reference is turned when the movement begins: what counts
    then is how far the heading drifts.
    """
    seen = recording.counted & ~np.isnan(reference).any(axis=1)
    first = np.flatnonzero(seen)[:1] if axes == 6 else np.flatnonzero(seen)
    between = products(reference[first], turned[first] * (-1.0, -1.0, -1.0, 1.0))
    z, w = between[:, 2], between[:, 3]
    # The mean direction of headings that go round.
    angle = float(np.angle(np.mean(np.exp(2j * np.arctan2(z, w)))))
    if axes == 9:
        angle = np.pi / 2 * round(angle / (np.pi / 2))
    turn = np.array((0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)))
    return products(np.broadcast_to(turn, turned.shape), turned)


def _broad_cells(errors: Sequence[Errors]) -> tuple[str, ...]:
    def mean(part: str) -> str:
        return f'{statistics.mean(getattr(each, part) for each in errors):.2f}'

    def worst(part: str) -> str:
        return f'{max(getattr(each, part) for each in errors):.1f}'

    return (mean('total'), mean('heading'), mean('inclination'), worst('total'),
            worst('inclination'))
