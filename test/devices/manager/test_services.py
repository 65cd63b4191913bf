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

"""Services are started for the devices that name them, once, and handed to these alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.devices.device import Device
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.devices.service import RunningServices
from rt_robot_os.devices.service import Service
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus

CALLS: list[str] = []


class Clock(Service):
    """Gives the path that it may use."""

    def start(self, path: Path) -> Any:
        CALLS.append(f'start {path.name}')
        return path

    def stop(self) -> None:
        CALLS.append('stop')


class Broken(Clock):
    """Cannot be started."""

    def start(self, path: Path) -> Any:
        CALLS.append('broken')
        raise DeviceError('it did not start')


class Plain(Device):
    """Asks for nothing."""

    def open(self) -> None:  # noqa: A003
        pass

    def close(self) -> None:
        pass

    def read(self, now_ns: int) -> int:
        return 0

    def publications(self) -> tuple[TopicSpec, ...]:
        return ()

    def statistics(self) -> DeviceStatistics:
        return DeviceStatistics()


class Asking(Plain):
    """Asks for what there is, and for what nobody offers."""

    SERVICES = ('clock', 'nobody')


class One(Plain):
    """Asks for one."""

    SERVICES = ('clock',)


class Both(Plain):
    """Asks for one that cannot be started."""

    SERVICES = ('clock', 'broken')


@pytest.fixture(autouse=True)
def plugged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    CALLS.clear()
    facts = tmp_path / 'clocks-1.0.dist-info'
    facts.mkdir()
    facts.joinpath('METADATA').write_text('Metadata-Version: 2.1\nName: clocks\nVersion: 1.0\n')
    facts.joinpath('entry_points.txt').write_text(
        f'[rt_robot_os.device_services]\nclock = {__name__}:Clock\nbroken = {__name__}:Broken\n')
    monkeypatch.syspath_prepend(str(tmp_path))


def test_a_service_is_started_once_for_all_that_name_it(tmp_path: Path) -> None:
    services = RunningServices()
    path = tmp_path / 'robot.sock'
    assert services.start([Plain, One, One], path) == {'clock': tmp_path / 'robot.clock'}
    services.stop()
    services.stop()
    assert CALLS == ['start robot.clock', 'stop']
    assert RunningServices().start([Plain], path) == {} and len(CALLS) == 2


def test_those_before_one_that_cannot_start_are_stopped(tmp_path: Path) -> None:
    services = RunningServices()
    with pytest.raises(DeviceError):
        services.start([Both], tmp_path / 'robot.sock')
    services.stop()
    assert CALLS == ['start robot.clock', 'broken', 'stop', 'stop']
    with pytest.raises(ConfigError, match="there is no service of devices 'nobody'"):
        services.start([Asking], tmp_path / 'robot.sock')


@pytest.mark.parametrize(('kind', 'given'), [
    (Plain, {}), (One, {'clock': 7}), (Asking, {'clock': 7})])
def test_a_device_gets_what_it_asks_for_and_no_more(
        kind: type[Device], given: dict[str, Any]) -> None:
    kernel = Kernel(VirtualClock())
    manager = SensorManager(kernel, Bus(kernel), Reports(), services={'clock': 7, 'other': 8})
    device = kind('it', {})
    manager.add(device, rate_hz=1.0, priority=5)
    assert device.services == given
