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

"""The tracking laws by name, and their gains as settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any
from typing import Final

from rt_robot_os.base.schema import declared
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import made
from rt_robot_os.motion.controllers.base import Controller
from rt_robot_os.motion.controllers.kanayama import Kanayama
from rt_robot_os.motion.controllers.park_kuipers import ParkKuipers
from rt_robot_os.motion.controllers.regulated_pure_pursuit import RegulatedPurePursuit
from rt_robot_os.motion.controllers.samson import Samson

CONTROLLERS: Final[Mapping[str, type[Controller]]] = {
    law.NAME: law for law in (Kanayama, Samson, RegulatedPurePursuit, ParkKuipers)}


def make_controller(name: str, gains: Mapping[str, Any] = {}) -> Controller:
    """
    Make a tracking law; not for the hot path.

    :param name: one of :data:`CONTROLLERS`.
    :param gains: by the names of its dataclass, or prefixed with the name of the law as in
        :func:`gain_fields`; a missing one has its default.
    """
    law: Any = CONTROLLERS[name]
    prefix = f'{name}_'
    values = {**gains, **{key.removeprefix(prefix): value for key, value in gains.items()
                          if key.startswith(prefix)}}
    return law(made(law.Gains, values))  # type: ignore[no-any-return]


def gain_fields() -> tuple[Field, ...]:
    """Return the gains of all laws as settings, each with the name of its law before its own."""
    return tuple(replace(field, name=f'{law.NAME}_{field.name}')
                 for law in CONTROLLERS.values() for field in declared(law.Gains))
