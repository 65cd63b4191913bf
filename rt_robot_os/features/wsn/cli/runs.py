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


"""Parallel simulations: variants of a scenario, each with several seeds."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from concurrent.futures import as_completed
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from dataclasses import replace
import math
import multiprocessing
import os
import signal

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.wsn.simulator.results import Results
from rt_robot_os.features.wsn.simulator.scenario import Scenario
from rt_robot_os.features.wsn.simulator.scenario import settled
from rt_robot_os.features.wsn.simulator.simulation import Simulation
from rt_robot_os.features.wsn.simulator.topology import make_topology

FIXED, MOVING = 'fixed', 'moving'


@dataclass(frozen=True)
class Variant:
    """
    One column of a table.

    :ivar label: its heading.
    :ivar scenario: of the first seed.
    """

    label: str
    scenario: Scenario


def run_one(scenario: Scenario, with_host: bool = False) -> Results:
    """
    Run a complete scenario from start to end.

    :param with_host: also run the robot's model of the network.
    """
    simulation = Simulation(scenario, make_topology(scenario), with_host=with_host)
    simulation.run()
    return simulation.results()


def run_all(variants: Sequence[Variant], seeds: int, jobs: int = 0,
            progress: Callable[[int, int], None] | None = None
            ) -> tuple[Mapping[str, Sequence[Results]], bool]:
    """
    Run each variant with several seeds, counted from its own.

    :param jobs: parallel processes; 0: one for each processor.
    :param progress: called with the number of completed runs and of all runs.
    :return: results by label, in the order of the seeds; and whether they are complete, which they
        are not after Ctrl-C.
    :raises ConfigError: a file of a network cannot be read.
    """
    tasks = [replace(variant.scenario, seed=variant.scenario.seed + index)
             for variant in variants for index in range(seeds)]
    found: dict[int, Results] = {}
    whole = True
    try:
        for index, result in _computed(tasks, jobs, False):
            found[index] = result
            if progress is not None:
                progress(len(found), len(tasks))
    except KeyboardInterrupt:
        whole = False
    return {variant.label: runs for place, variant in enumerate(variants) if (runs := [
        found[index] for index in range(place * seeds, (place + 1) * seeds) if index in found])
    }, whole


def run_each(scenarios: Sequence[Scenario], jobs: int = 0,
             progress: Callable[[int, int], None] | None = None, with_host: bool = False
             ) -> list[Results]:
    """
    Run complete scenarios.

    :param jobs: as for :func:`run_all`, and so is ``progress``.
    :param with_host: as for :func:`run_one`.
    :return: their results, in their order.
    """
    found: dict[int, Results] = {}
    for index, result in _computed(scenarios, jobs, with_host):
        found[index] = result
        if progress is not None:
            progress(len(found), len(scenarios))
    return [found[index] for index in range(len(scenarios))]


def _computed(scenarios: Sequence[Scenario], jobs: int, with_host: bool
              ) -> Iterator[tuple[int, Results]]:
    count = min(jobs or len(os.sched_getaffinity(0)), len(scenarios))
    if count <= 1:
        for index, scenario in enumerate(scenarios):
            yield index, run_one(scenario, with_host)
        return
    with ProcessPoolExecutor(count, multiprocessing.get_context('spawn'), _leave_ctrl_c) as pool:
        waiting = {pool.submit(run_one, scenario, with_host): index
                   for index, scenario in enumerate(scenarios)}
        try:
            for future in as_completed(waiting):
                yield waiting[future], future.result()
        finally:
            for future in waiting:
                future.cancel()


def _leave_ctrl_c() -> None:
    """Ignore Ctrl-C: the parent process handles it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def with_nodes(scenario: Scenario, count: int) -> Scenario:
    """
    Return the scenario with another number of random nodes of the same density.

    :raises ConfigError: its nodes are not random.
    """
    topology = scenario.topology
    if not topology.random:
        raise ConfigError([f'{scenario.name}: --sizes needs topology.random'])
    scale = math.sqrt(count / topology.random) if not topology.map else 1.0
    return replace(scenario, topology=replace(
        topology, random=count, width_m=topology.width_m * scale,
        depth_m=topology.depth_m * scale))


def with_sink(scenario: Scenario, sink: str) -> Scenario:
    """
    Return the scenario with a fixed or a moving sink.

    The default route is a rectangle around the middle of the area, half as wide and deep.

    :raises ConfigError: there is no area.
    """
    if sink == FIXED:
        return replace(scenario, sink=replace(scenario.sink, way=()))
    if scenario.sink.way:
        return scenario
    topology = scenario.topology
    if not topology.random or topology.map:
        raise ConfigError([f'{scenario.name}: --sink moving: set its route in sink.way'])
    width, depth = topology.width_m, topology.depth_m
    corners = ((0.25, 0.25), (0.75, 0.25), (0.75, 0.75), (0.25, 0.75))
    return replace(scenario, sink=replace(scenario.sink, way=tuple(
        f'{x * width:.2f} {y * depth:.2f}' for x, y in corners)))


def with_protocol(scenario: Scenario, protocol: str) -> Scenario:
    """Return the scenario with another protocol, and the defaults that depend on it."""
    if protocol == scenario.protocol:
        return scenario
    tossim = scenario.radio.mac == 'tossim'
    return settled(replace(
        scenario, protocol=protocol, tinyos=None, u16_wrap=None,
        longest_interval_binary_ms=None,
        beacon_period_ms=None if protocol == 'ctp' else scenario.beacon_period_ms,
        beacon_period_binary_ms=None if protocol == 'ctp' else scenario.beacon_period_binary_ms,
        radio=replace(scenario.radio, mac='tossim' if tossim else None, acknowledge=None),
        traffic=replace(scenario.traffic, payload=None)))
