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

"""Check the mountings of the devices' frames: one for each frame, and no cycle."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.settings.model import frozen
from rt_robot_os.settings.model import MountedFrame
from rt_robot_os.settings.parts import PartSection
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.tree import Origin
from rt_robot_os.settings.tree import show

KEYS: Final = ('mounting_m', 'mounting_rad', 'parent_frame_id')
# REP 105: the robot moves in these frames, so no device is mounted in them.
WORLD_FRAMES: Final = frozenset({'earth', 'map', 'odom'})


@dataclass(frozen=True, slots=True)
class _Claim:
    mounting: Mounting
    device: str
    origin: Origin
    stated: bool


def check_mountings(devices: Iterable[PartSection], problems: Problems
                    ) -> tuple[MountedFrame, ...]:
    """
    Find frames with two mountings, cycles, and names that tf2 refuses.

    A default mounting is replaced by the mounting of another device with the same frame.

    :return: each frame once, without those that are not on the robot.
    """
    claims: dict[str, _Claim] = {}
    for part in devices:
        for frame_id, claim in _claims(part, problems):
            other = claims.setdefault(frame_id, claim)
            if not claim.stated:
                continue
            if other.stated and other.mounting != claim.mounting:
                problems.add(claim.origin, f'{part.name} mounts {frame_id!r} at '
                             f'{_text(claim.mounting)}, but {other.device} ({other.origin}) at '
                             f'{_text(other.mounting)}: set it for one of them, or give each its '
                             'own frame_id')
            claims[frame_id] = claim
    for frame_id in claims:
        _check_cycle(frame_id, claims, problems)
    return tuple(MountedFrame(frame_id, claim.mounting, claim.stated)
                 for frame_id, claim in claims.items())


def _claims(part: PartSection, problems: Problems) -> Iterable[tuple[str, _Claim]]:
    section, kind = part.section, part.kind
    if kind is None or any(each.name not in section.values for each in kind.fields):
        return  # another problem, which is reported elsewhere
    stated = [each.name for each in kind.fields if each.name in KEYS
              and frozen(section.values[each.name]) != each.default]
    origin = section.where(stated[0] if stated else 'frame_id')
    try:
        mountings = kind.mountings(part.own())
    except ConfigError as error:
        for text in error.problems:
            problems.add(origin, f'{part.name}.{text}')
        return
    for frame_id, mounting in mountings.items():
        if stated:
            _check_names(part, frame_id, mounting, problems)
        at_rest = mounting == Mounting(parent=frame_id)
        if frame_id not in WORLD_FRAMES and not at_rest:
            yield frame_id, _Claim(mounting, part.name, origin, bool(stated))


def _check_names(part: PartSection, frame_id: str, mounting: Mounting, problems: Problems) -> None:
    for key, name in (('frame_id', frame_id), ('parent_frame_id', mounting.parent)):
        if not name or name.startswith('/'):
            problems.value(part.section.where(key), f'{part.name}.{key}', name,
                           'tf2 refuses empty names and names that begin with a slash')


def _check_cycle(frame_id: str, claims: dict[str, _Claim], problems: Problems) -> None:
    """Follow the parents; a cycle is reported once, for the first of its frames."""
    path = [frame_id]
    while path[-1] in claims:
        path.append(claims[path[-1]].mounting.parent)
        if path[-1] != frame_id and path[-1] in path[:-1]:
            return  # it leads into a cycle of other frames
        if path[-1] == frame_id:
            if frame_id == min(path):
                claim = claims[frame_id]
                problems.add(claim.origin, f'{claim.device}: {" on ".join(map(repr, path))}: a '
                             'frame cannot be its own parent, set another parent_frame_id')
            return


def _text(mounting: Mounting) -> str:
    return (f'{show(mounting.position_m)} m, {show(mounting.rotation_rad)} rad in '
            f'{mounting.parent!r}')
