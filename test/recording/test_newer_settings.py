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

"""A recording of an earlier release replays although settings were added since."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('mcap', reason='no recordings without the library mcap')

from rt_robot_os.recording.newer_settings import completed  # noqa: E402
from rt_robot_os.settings import load  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]


def without(settings: Any, names: set[str]) -> Any:
    """Return settings as a release wrote them that did not have some keys."""
    def cut(parts: Any) -> Any:
        return tuple(replace(each, settings={key: value for key, value in each.settings.items()
                                             if key not in names}) for each in parts)
    return replace(settings, devices=cut(settings.devices), modules=cut(settings.modules))


def test_what_is_newer_is_completed_so_that_a_replay_is_alike() -> None:
    settings = load([ROOT / 'config' / 'service_robot.yaml'])
    newer = {'unseen', 'run_on_max_m', 'lowest_mv', 'coast_s'}
    found, added = completed(without(settings, newer))
    values = {f'{each.name}.{key}': value for each in (*found.devices, *found.modules)
              for key, value in each.settings.items()}
    guards = [each.name for each in settings.modules if each.type == 'collision_guard']
    assert guards and all(f'{name}.unseen' in added for name in guards)
    assert all(values[f'{name}.unseen'] == 'stop' for name in guards)
    # What did not exist had no effect, which is not what is the default now.
    slowing = [key for key in added if key.endswith('.run_on_max_m')]
    assert slowing and all(values[key] == 0.0 for key in slowing)
    # A board that declared nothing goes on to declare nothing.
    assert not any(key.endswith('.coast_s') for key in values)


def test_settings_of_this_release_are_left_alone() -> None:
    settings = load([ROOT / 'config' / 'service_robot.yaml'])
    assert completed(settings) == (settings, [])
