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
Rehearse alarms: thousands of emergencies while every part fails now and then.

Each emergency must end acknowledged, or with its escalation exhausted; no person may be shown the
same notification twice. The same seed gives the same run.
"""

from __future__ import annotations

import hashlib
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.cli.rehearsal_result import RehearsalResult
from rt_robot_os.features.alarms.cli.rehearsal_scene import RehearsalRun

#: Emergencies of one robot; then another one begins, with a seed of its own.
A_SCENE: Final = 40


def rehearse(alarms: int, seed: int, first: int = 0) -> RehearsalResult:
    """
    Run scenes with this number of alarms in all.

    :param first: the scene to begin with, to repeat one.
    """
    result = RehearsalResult()
    digest = hashlib.sha256()
    number = first
    while result.alarms < alarms:
        scene = RehearsalRun(seed * 1_000_003 + number, min(A_SCENE, alarms - result.alarms))
        begun_ns = scene.timeline.now_ns
        if not scene.run():
            result.scenes_lost.append(number)
        found = list(scene.all.values())
        result.alarms += len(found)
        result.acknowledged += sum(each.acknowledged for each in found)
        result.top += sum(each.top and not each.acknowledged for each in found)
        result.lost += sum(not each.ended for each in found)
        for person in scene.people.values():
            result.shown += len(person.shown)
            result.shown_twice += person.twice
            result.folded += person.folded
        result.told_anew += scene.told_anew
        result.forgotten += scene.forgotten
        result.virtual_hours += (scene.timeline.now_ns - begun_ns) / (3600 * NS_PER_S)
        result.went_wrong += scene.went_wrong
        digest.update(scene.digest.digest())
        number += 1
    result.virtual_hours = round(result.virtual_hours, 2)
    result.digest = digest.hexdigest()[:16]
    return result
