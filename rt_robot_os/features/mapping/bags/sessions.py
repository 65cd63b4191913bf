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

"""Metadata of recordings by `record`: the session, and the mountings of devices."""

from __future__ import annotations

from collections.abc import Sequence
import json
import math
from pathlib import Path
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import RecordingError
from rt_robot_os.motion.mounting import Mounting


class RecordingSessions:
    """
    The sessions of a recording; a bag of another program has none.

    Odometry restarts with the core, so only one session is mapped.

    :param wanted: its number; None for the first.
    :raises ConfigError: there is no such session.
    :ivar mountings: of the devices of the robot.
    :ivar problems: what was skipped.
    """

    def __init__(self, files: Sequence[Path], wanted: int | None) -> None:
        self.mountings: dict[str, Mounting] = {}
        self.problems: list[str] = []
        self._numbers: dict[Path, int] = {}
        settings: dict[int, str | None] = {}
        for file in files:
            found = _beginning(file)
            if found is not None:
                self._numbers[file] = found[0]
                settings.setdefault(*found)
        if wanted is not None and wanted not in settings:
            raise ConfigError([f'--session {wanted}: there is none; there are '
                               f'{", ".join(map(str, sorted(settings))) or "no sessions at all"}'])
        self._chosen = min(settings, default=None) if wanted is None else wanted
        others = sorted(set(settings) - {self._chosen})
        if others:
            self.problems.append(
                f'this is session {self._chosen}; the core was restarted meanwhile: choose '
                f'{", ".join(map(str, others))} with --session for the others')
        if self._chosen is not None and settings[self._chosen]:
            self.mountings = _mountings(str(settings[self._chosen]))

    def leaves_out(self, file: Path) -> bool:
        """Return whether a file is of another session."""
        return self._numbers.get(file, self._chosen) != self._chosen


def _beginning(file: Path) -> tuple[int, str | None] | None:
    """Return session number and settings of a file; None when it is not by `record`."""
    try:
        from rt_robot_os.recording.reading import beginning_of
        facts, settings = beginning_of(file, [])  # reported by the reader of the messages
    except (RecordingError, ImportError, OSError):
        return None  # the reader of the messages reports it
    return None if facts is None else (facts.number, settings)


def _mountings(settings: str) -> dict[str, Mounting]:
    """Return the mountings in the settings; none if they have none."""
    try:
        frames: list[dict[str, Any]] = json.loads(settings).get('frames') or []
        found = {}
        for each in frames:
            mounting = each['mounting']
            place, turn = ([float(number) for number in mounting[key]]
                           for key in ('position_m', 'rotation_rad'))
            if len(place) == len(turn) == 3 and all(map(math.isfinite, (*place, *turn))):
                found[str(each['frame_id'])] = Mounting(
                    (place[0], place[1], place[2]), (turn[0], turn[1], turn[2]),
                    str(mounting['parent']))
        return found
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}
