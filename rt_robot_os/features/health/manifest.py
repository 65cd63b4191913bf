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

"""What the feature `health` brings."""

from typing import Final

from rt_robot_os.base.features import Feature

FEATURE: Final = Feature(
    summary='Vital signs, falls, rules and scores, and where a person is',
    modules={
        'assessment': '.assessment:Assessment',
        'fall_detector': '.fall_detector:FallDetection',
        'pulse_check': '.pulse_check:PulseCheck',
        'rule': '.rule:RuleModule',
        'vital_signs': '.vital_signs:VitalSigns',
        'whereabouts': '.whereabouts:Whereabouts',
    },
    devices={
        'oximeter': '.oximeter',
    },
    programs={
        'health': '.cli.program',
    },
    requires=('wsn',),
)
