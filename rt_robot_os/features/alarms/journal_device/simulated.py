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
A simulated journal: a socket that gives the driver the real process, on an empty folder.

Faults of the disk and of the process can be simulated.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
import resource
import shutil
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.devices.capture.simulated import CAPTURE_FAULTS
from rt_robot_os.devices.capture.simulated import SimulatedCapture
from rt_robot_os.sim.base import NOWHERE
from rt_robot_os.sim.base import Site

WORKER: Final = 'rt_robot_os.features.alarms.journal_device.worker'
_FULL: Final = 'full'


class SimulatedJournal(SimulatedCapture):
    """A journal that starts empty."""

    SETTINGS: ClassVar[tuple[Field, ...]] = (
        Field('faults', list, (), f'schedule of {", ".join((*CAPTURE_FAULTS, _FULL))}, such as '
              '"full at 5 for 20" (seconds)'),)
    FAULTS: ClassVar[Mapping[str, str]] = {
        **CAPTURE_FAULTS, _FULL: 'the disk is full'}
    WORKER: ClassVar[str] = WORKER

    def __init__(self, name: str, settings: Mapping[str, Any], path: Path,
                 site: Site = NOWHERE) -> None:
        super().__init__(name, settings, path, site)
        shutil.rmtree(path.with_name(f'{path.name}.files'), ignore_errors=True)

    def pump(self, now_ns: int) -> None:
        """
        Start requested processes, and apply faults.

        :raises DeviceError: the port cannot be made again after a fault.
        """
        super().pump(now_ns)
        # At most what this process may use, or an ordinary user could not end the fault.
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        limit = 0 if _FULL in self.faults.active(now_ns) else soft
        for worker in self.port.workers:
            if worker.poll() is None:
                with suppress(ProcessLookupError):
                    resource.prlimit(worker.pid, resource.RLIMIT_FSIZE, (limit, hard))
