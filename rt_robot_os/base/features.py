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
What each feature brings: its modules, devices and programs, and the features that it needs.

A feature is a folder of ``rt_robot_os/features/``. Its ``manifest.py`` declares ``FEATURE`` and
imports nothing else. ``setup.py``, the registries of modules and devices, the tests and the
documentation read the manifests, so a feature is added by adding its folder.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace
import functools
from importlib import import_module
from pathlib import Path
from typing import Final

_PACKAGE: Final = 'rt_robot_os.features'
_FOLDER: Final = Path(__file__).resolve().parents[1] / 'features'


@dataclass(frozen=True)
class Feature:
    """
    The manifest of a feature; names of modules that begin with a dot are inside its folder.

    :ivar summary: what it does, for the documentation.
    :ivar modules: ``type`` in the configuration -> ``module:Class``.
    :ivar devices: ``type`` in the configuration -> folder with ``PARTS``.
    :ivar programs: name -> the module whose ``main`` it is.
    :ivar requires: other features that it may import.
    """

    summary: str
    modules: Mapping[str, str] = field(default_factory=dict)
    devices: Mapping[str, str] = field(default_factory=dict)
    programs: Mapping[str, str] = field(default_factory=dict)
    requires: tuple[str, ...] = ()

    def inside(self, folder: str) -> Feature:
        """Return it with the whole names of its modules."""
        def whole(targets: Mapping[str, str]) -> dict[str, str]:
            return {name: f'{folder}{target}' if target.startswith('.') else target
                    for name, target in targets.items()}

        return replace(self, modules=whole(self.modules), devices=whole(self.devices),
                       programs=whole(self.programs))


@functools.cache
def features() -> Mapping[str, Feature]:
    """Return the features by name, sorted; not for the real-time loop."""
    names = sorted(path.parent.name for path in _FOLDER.glob('*/manifest.py'))
    return {name: import_module(f'{_PACKAGE}.{name}.manifest').FEATURE.inside(
        f'{_PACKAGE}.{name}') for name in names}


def modules() -> dict[str, str]:
    """Return the modules of all features: ``type`` -> ``module:Class``."""
    return {name: target for each in features().values() for name, target in each.modules.items()}


def devices() -> dict[str, str]:
    """Return the devices of all features: ``type`` -> folder."""
    return {name: target for each in features().values() for name, target in each.devices.items()}


def programs() -> dict[str, str]:
    """Return the programs of all features: name -> module."""
    return {name: target for each in features().values()
            for name, target in each.programs.items()}
