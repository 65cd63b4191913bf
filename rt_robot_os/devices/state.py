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

"""The state and the statistics of a device under the SensorManager, and its time-outs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.kernel import FailurePolicy

_SHARED = ('budget_ns', 'on_budget', 'failure', 'restart_ns', 'restart_maximum_ns', 'resources')


class DeviceState(Enum):
    """
    The state of a device.

    CLOSED: not started. OPENING: its port is open, no valid frame yet. ACTIVE: valid frames
    arrive. FAULT: none do; it will be reopened.
    """

    CLOSED = 'closed'
    OPENING = 'opening'
    ACTIVE = 'active'
    FAULT = 'fault'


@dataclass(frozen=True)
class SensorStatistics:
    """
    The state of a device, and its counters.

    :ivar reason: why it is in FAULT, or was before it was reopened; when active, its own warning,
        or the remedy where its valid frames give no sample. Otherwise empty.
    :ivar faults: number of changes to FAULT.
    :ivar opened: number of times that its port was opened.
    :ivar age_ns: time since the last valid frame; -1 if there was none.
    """

    name: str
    state: DeviceState
    reason: str
    faults: int
    opened: int
    age_ns: int
    device: DeviceStatistics


@dataclass(frozen=True)
class RecoverySettings:
    """
    When a device goes to FAULT and when it is reopened.

    :ivar timeout_ns: without a valid frame for this long it goes to FAULT.
    :ivar retry_ns: first pause before reopening; it doubles with each failure.
    :ivar retry_maximum_ns: longest pause.
    """

    timeout_ns: int = NS_PER_S
    retry_ns: int = NS_PER_S // 2
    retry_maximum_ns: int = 10 * NS_PER_S


def of_arrival(declared: Mapping[str, Any], guards: bool) -> dict[str, Any]:
    """
    Return the declarations of the polling task that apply to the task that reads on arrival.

    :param guards: it brings the device to rest when the polling task does not, so it must keep
        running.
    """
    found = {key: declared[key] for key in _SHARED if key in declared}
    if guards and found.get('failure') is not FailurePolicy.SAFE_STATE:
        found['failure'] = FailurePolicy.CONTINUE
    elif found.get('failure') is FailurePolicy.SAFE_STATE and not guards:
        # The polling task also reads bytes, so its policy decides for the device.
        found['failure'] = FailurePolicy.STOP
    return found


def reason_of(error: Exception) -> str:
    """Return the reason of an error; one that is not a DeviceError is a defect of the driver."""
    if isinstance(error, DeviceError):
        return str(error)
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    where = f' ({place.tb_frame.f_code.co_filename}:{place.tb_lineno})' if place else ''
    return f'its driver is defective: {type(error).__name__}: {error}{where}'
