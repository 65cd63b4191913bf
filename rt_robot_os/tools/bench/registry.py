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
All cases, in the order in which they run.

Installed are those that show what the package promises, and those that qualify a machine. The
others are in the folder ``benchmarks`` of the source tree, and are found where that is.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
import sys
from types import MappingProxyType

from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.cases.kernel import case as kernel
from rt_robot_os.tools.bench.cases.mirror import case as mirror
from rt_robot_os.tools.bench.cases.overload import case as overload
from rt_robot_os.tools.bench.cases.preemption import case as preemption
from rt_robot_os.tools.bench.cases.spacing import case as spacing
from rt_robot_os.tools.bench.cases.stability import case as stability
from rt_robot_os.tools.bench.cases.wakeup import case as wakeup
from rt_robot_os.tools.bench.processes import ROOT

INSTALLED: Mapping[str, Case] = MappingProxyType({case.name: case for case in (
    stability.CASE, preemption.CASE, overload.CASE, mirror.CASE, wakeup.CASE, kernel.CASE,
    spacing.CASE)})
#: Of the installed cases and those of the source tree.
ORDER = (
    'frequency', 'delay', 'load', 'stability', 'preemption', 'overload', 'serial', 'sink',
    'reaction', 'emergency', 'trajectory', 'mirror', 'capture', 'gateway', 'wakeup', 'throughput',
    'kernel', 'micro', 'spacing', 'localization', 'control', 'devices', 'routing', 'network',
    'slam', 'start', 'memory')
SOURCE_ONLY = tuple(name for name in ORDER if name not in INSTALLED)
_FURTHER = 'benchmarks.registry'


def cases(root: Path = ROOT) -> Mapping[str, Case]:
    """Return the cases that can run here: the installed ones, in a source tree all."""
    known = {**INSTALLED, **_further(root)}
    return {name: known[name] for name in ORDER if name in known}


def _further(root: Path) -> Mapping[str, Case]:
    if not root.joinpath(*_FURTHER.split('.')).with_suffix('.py').is_file():
        return {}
    if str(root) not in sys.path:
        sys.path.append(str(root))
    found: Mapping[str, Case] = import_module(_FURTHER).CASES
    return found


CASES = cases()
