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


"""What the case routing measures: simulated networks, by protocol, sink, size and load."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rt_robot_os.features.wsn.cli.runs import run_each
from rt_robot_os.features.wsn.cli.runs import Variant
from rt_robot_os.features.wsn.cli.runs import with_nodes
from rt_robot_os.features.wsn.cli.runs import with_sink
from rt_robot_os.features.wsn.cli.scenario_file import find_scenario
from rt_robot_os.features.wsn.cli.scenario_file import load_scenario
from rt_robot_os.features.wsn.simulator.results import Results
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement

MILLIONTHS = 1_000_000
THOUSANDTHS = 1000
# Longer than any battery lasts.
_MOST_DAYS = 1e6


def _scenario(name: str, **overrides: Any) -> Any:
    return load_scenario(find_scenario(name), overrides)[0]


#: What is kept of each run: its name, and how it is got, in whole numbers.
KEPT: Mapping[str, Callable[[Results], float]] = {
    'delivery_ppm': lambda one: MILLIONTHS * one.delivery,
    'frames_milli': lambda one: THOUSANDTHS * one.per_delivery(one.transmissions),
    'p95_us': lambda one: THOUSANDTHS * one.latency_ms(0.95),
    'breaks': lambda one: len(one.gaps),
    'longest_ms': lambda one: THOUSANDTHS * (one.gap_s[-1] if one.gaps else 0.0),
    'load_milli': lambda one: THOUSANDTHS * one.load_ratio,
    'charge_milli': lambda one: THOUSANDTHS * one.energy_ratio,
    'days_milli': lambda one: THOUSANDTHS * min(one.first_empty_days, _MOST_DAYS),
    'serial_duplicates': lambda one: one.duplicates,
    'duplicates': lambda one: one.host.get('duplicates_to_application', 0),
    'withheld': lambda one: one.host.get('withheld', 0),
    'differ': lambda one: len(one.host.get('losses_that_differ', ())),
    'speed': lambda one: one.ended_s / one.wall_s,
}


def _kept(variants: Sequence[Variant], seeds: int, with_host: bool = False) -> Measurement:
    """Run each variant with its seeds; ``label name`` are the samples, one a seed."""
    tasks = [replace(variant.scenario, seed=seed + 1) for variant in variants
             for seed in range(seeds)]
    found = run_each(tasks, with_host=with_host)
    samples: dict[str, Samples] = {}
    for index, variant in enumerate(variants):
        runs = found[index * seeds:(index + 1) * seeds]
        for name, of in KEPT.items():
            values = np.array([of(one) for one in runs], np.float64)
            # Where nothing came there is no latency; there is no such number among ours.
            samples[f'{variant.label} {name}'] = np.nan_to_num(values, nan=-1.0).round().astype(
                np.int64)
    return Measurement(samples)


def home(harness: Harness) -> Measurement:
    """Run the networks of home size, with the robot's count beside the truth."""
    seconds, rows = harness.arguments['seconds'], harness.arguments['rows']
    return _kept([Variant(key, _scenario(name, protocol=protocol, seconds=float(seconds)))
                  for key, name, protocol in rows], harness.arguments['seeds'], True)


def load(harness: Harness) -> Measurement:
    """Run a noisy grid with a packet more and more rarely, to show where a protocol collapses."""
    variants = []
    for protocol in harness.arguments['protocols']:
        for period in harness.arguments['periods_binary_ms']:
            variants.append(Variant(f'{protocol} {period}', _scenario(
                'ctp_collapse', protocol=protocol, seconds=float(harness.arguments['seconds']),
                traffic={'period_binary_ms': float(period)})))
    return _kept(variants, harness.arguments['seeds'])


def relays(harness: Harness) -> Measurement:
    """Run networks of several sizes: the sink in the middle, in a corner, and one that drives."""
    scenario = _scenario('relay_load', seconds=float(harness.arguments['seconds']))
    variants = []
    for size in harness.arguments['sizes']:
        sized = with_nodes(scenario, size)
        fixed = with_sink(sized, 'fixed')
        variants += [Variant(f'{size} fixed', fixed),
                     Variant(f'{size} corner', replace(
                         fixed, sink=replace(fixed.sink, place=(0.0, 0.0)))),
                     Variant(f'{size} moving', with_sink(sized, 'moving'))]
    return _kept(variants, harness.arguments['seeds'])
