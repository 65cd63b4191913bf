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
Test tools for your own drivers and modules: no hardware, no waiting.

For a driver: :class:`DriverContract`, the suite that every serial driver must pass (and
:class:`DecoderContract`, its part for a decoder alone);
:func:`scripted`, a device whose port returns the bytes of the test; :func:`rig`, a driver and its
simulated device on a real pty, with time controlled by the test. For an actuator:
:class:`ActuatorContract` as well. For a module: :class:`ModuleBench`, a
kernel on the virtual clock. Needs pytest, and the contracts hypothesis; a robot needs neither.
"""

from __future__ import annotations

import pytest

# Before they are imported: their asserts then show the values.
pytest.register_assert_rewrite(*(f'{__name__}.{part}' for part in (
    'actuator_contract', 'actuator_rig', 'contract', 'decoder_contract', 'fakes', 'module_bench',
    'rig', 'sample_contract')))

from rt_robot_os.testing.actuator_contract import ActuatorContract  # noqa: E402
from rt_robot_os.testing.actuator_rig import ActuatorRig  # noqa: E402
from rt_robot_os.testing.contract import DriverContract  # noqa: E402
from rt_robot_os.testing.decoder_contract import DecoderContract  # noqa: E402
from rt_robot_os.testing.fakes import RecordingPublisher  # noqa: E402
from rt_robot_os.testing.fakes import scripted  # noqa: E402
from rt_robot_os.testing.fakes import settings_of  # noqa: E402
from rt_robot_os.testing.module_bench import ModuleBench  # noqa: E402
from rt_robot_os.testing.rig import Rig  # noqa: E402
from rt_robot_os.testing.rig import rig  # noqa: E402

__all__ = ['ActuatorContract', 'ActuatorRig', 'DecoderContract', 'DriverContract', 'ModuleBench',
           'RecordingPublisher', 'Rig', 'rig', 'scripted', 'settings_of']
