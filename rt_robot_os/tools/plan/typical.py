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
What devices and modules of this package typically take, for a plan before anything is measured.

The table is next to this file and is made by ``./scripts/bench typical_times``. It is not a bound,
and another machine has other times; the report states that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
import functools
import json
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.settings import RobotSettings
from rt_robot_os.tools.plan.wiring import Wiring

FORMAT: Final = 1
PATH: Final = Path(__file__).with_name('typical.json')


@dataclass(frozen=True, slots=True)
class TypicalDriver:
    """
    A driver in the table.

    :ivar execution_us: of a poll; of a job that arriving bytes release: ``arrival_us``, 0 when
        that was not measured.
    :ivar samples: that a poll found at most, on average: one that finds more takes longer.
    :ivar arrivals: releases by bytes for each sample.
    """

    execution_us: float
    arrival_us: float
    samples: float
    arrivals: float


@dataclass(frozen=True, slots=True)
class Typical:
    """
    The table.

    :ivar source: on which machine and how it was measured, for people.
    :ivar drivers: by type.
    :ivar modules: microseconds by type.
    :ivar core: microseconds by name of the task.
    :ivar connections_hz: how often clients connect.
    """

    source: str
    drivers: Mapping[str, TypicalDriver]
    modules: Mapping[str, float]
    core: Mapping[str, float]
    connections_hz: float


@dataclass(frozen=True, slots=True)
class TypicalTimes:
    """
    What the table holds for one robot.

    :ivar execution_ns: by task; tasks that it does not know are absent.
    :ivar rates_hz: of releases from outside, by task.
    """

    execution_ns: Mapping[str, int] = field(default_factory=dict)
    rates_hz: Mapping[str, float] = field(default_factory=dict)


@functools.cache
def shipped() -> Typical:
    """Read the table that comes with the package."""
    data: dict[str, Any] = json.loads(PATH.read_text())
    if data.pop('format') != FORMAT:
        raise ValueError(f'{PATH}: not of format {FORMAT}')
    drivers = {name: TypicalDriver(**each) for name, each in data.pop('drivers').items()}
    return Typical(drivers=drivers, **data)


def times_of(settings: RobotSettings, wiring: Wiring, typical: Typical) -> TypicalTimes:
    """Look up the tasks of a robot."""
    times_us = dict(typical.core)
    rates_hz = {'link/accept': typical.connections_hz}
    for device in settings.devices:
        known = typical.drivers.get(device.type)
        if known is None:
            continue
        samples_hz = wiring.samples_hz(device.name)
        polled = max(1.0, samples_hz / device.rate_hz)
        times_us[device.name] = known.execution_us * max(1.0, polled / known.samples)
        if known.arrival_us:
            times_us[f'{device.name}/arrival'] = known.arrival_us
            # One whose topics come when something happens, such as a journal: as often as polled.
            rates_hz[f'{device.name}/arrival'] = known.arrivals * (samples_hz or device.rate_hz)
    times_us.update({module.name: typical.modules[module.type] for module in settings.modules
                     if module.type in typical.modules})
    return TypicalTimes({name: round(time_us * NS_PER_US) for name, time_us in times_us.items()},
                        {name: rate_hz for name, rate_hz in rates_hz.items() if rate_hz})
