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

"""A simple model of alarms: states, levels and kinds, and nothing of how people are told."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field

from rt_robot_os.features.alarms.rules import Rules
from rt_robot_os.messages.cause import Level

SUSPECTED, RAISED, ACKNOWLEDGED = 'suspected', 'raised', 'acknowledged'
Key = tuple[str, bool]


@dataclass
class Kind:
    """A kind of cause in an alarm."""

    level: Level
    active: bool
    since: int
    over: int = 0


@dataclass
class ModelAlarm:
    """An alarm."""

    level: Level
    state: str
    since: int
    deadline: int = 0
    kinds: dict[str, Kind] = field(default_factory=dict)

    @property
    def over(self) -> int:
        """When all causes were over; 0 while one lasts."""
        if any(each.active for each in self.kinds.values()):
            return 0
        return max(each.over for each in self.kinds.values())


class Model:
    """The open alarms by subject, and whether they are technical."""

    def __init__(self, rules: Rules) -> None:
        self.rules = rules
        self.alarms: dict[Key, ModelAlarm] = {}
        # Causes whose alarm is over: level, until when they are held back, when they were heard.
        self.held: dict[tuple[str, str], tuple[Level, int, int]] = {}

    def cause(self, subject: str, kind: str, level: Level, active: bool, now: int) -> None:
        technical = level is Level.TECHNICAL
        for each in (False, True):
            alarm = self.alarms.get((subject, each))
            if alarm and kind in alarm.kinds and alarm.kinds[kind].active and (
                    not active or each != technical):
                alarm.kinds[kind].active, alarm.kinds[kind].over = False, now
        alarm = self.alarms.get((subject, technical))
        if not active:
            self.held.pop((subject, kind), None)
        elif alarm is not None:
            self.held.pop((subject, kind), None)
            self._fold(alarm, kind, level, now)
        elif not self._holds(subject, kind, level, now):
            suspect = kind in self.rules.confirm_kinds and not technical
            alarm = ModelAlarm(level, SUSPECTED if suspect else RAISED, now,
                               now + self.rules.confirm_ns if suspect else 0)
            alarm.kinds[kind] = Kind(level, True, now)
            self.alarms[subject, technical] = alarm

    def _holds(self, subject: str, kind: str, level: Level, now: int) -> bool:
        if (subject, kind) not in self.held:
            return False
        held, until, heard = self.held.pop((subject, kind))
        if level > held or now >= until or now - heard > self.rules.refresh_ns:
            return False
        self.held[subject, kind] = held, until, now
        return True

    def _fold(self, alarm: ModelAlarm, kind: str, level: Level, now: int) -> None:
        known = alarm.kinds.get(kind)
        worse = level > alarm.level
        if known is None:
            alarm.kinds[kind] = Kind(level, True, now)
            news = True
        else:
            ended, rose = not known.active, level > known.level
            since = known.over if ended else known.since
            news = worse or ((ended or rose) and now - since >= self.rules.again_ns)
            if ended or level != known.level:
                alarm.kinds[kind] = Kind(level, True, now)
        alarm.level = max(alarm.level, level)
        if not news:
            return
        if alarm.state == ACKNOWLEDGED or (alarm.state == SUSPECTED and (
                worse or kind not in self.rules.confirm_kinds)):
            alarm.state, alarm.since, alarm.deadline = RAISED, now, 0

    def acknowledge(self, key: Key, now: int) -> None:
        alarm = self.alarms[key]
        if alarm.state != ACKNOWLEDGED:
            alarm.state, alarm.since = ACKNOWLEDGED, now
            alarm.deadline = now + self.rules.remind_ns

    def confirm(self, key: Key, now: int) -> None:
        alarm = self.alarms[key]
        alarm.state, alarm.since, alarm.deadline = RAISED, now, 0

    def close(self, key: Key, now: int) -> None:
        alarm = self.alarms.pop(key)
        for kind, each in alarm.kinds.items():
            if each.active:
                self.held[key[0], kind] = each.level, now + self.rules.remind_ns, now

    def wait(self, now: int) -> None:
        for key, alarm in sorted(self.alarms.items()):
            self._pass(key, alarm, now)

    def _pass(self, key: Key, alarm: ModelAlarm, now: int) -> None:
        while True:
            ends = alarm.over and alarm.over + self.rules.resolve_after_ns
            if ends and alarm.state == ACKNOWLEDGED:
                ends = max(alarm.over, alarm.since) + self.rules.resolve_after_ns
            if alarm.state == SUSPECTED or (
                    alarm.state == RAISED and alarm.level not in self.rules.unseen_levels):
                ends = 0
            if ends and ends <= now and (not alarm.deadline or ends <= alarm.deadline):
                self.close(key, ends)
                return
            if not alarm.deadline or alarm.deadline > now:
                return
            alarm.state, alarm.since, alarm.deadline = RAISED, alarm.deadline, 0

    def restart(self, now: int) -> None:
        """Wait, and hear anew what is held back."""
        self.held = {key: (level, until, now) for key, (level, until, _) in self.held.items()
                     if until > now}
        self.wait(now)
