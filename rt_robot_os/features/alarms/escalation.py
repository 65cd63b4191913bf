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
The escalation of an alarm: which channels are notified when, and what follows a failure.

It changes the alarm and makes notifications; all times are handed in.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
import re
from typing import Final
from typing import NamedTuple
from typing import Protocol

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.alarm import Alarm
from rt_robot_os.features.alarms.alarm import Delivery
from rt_robot_os.messages.alarm_state import AlarmEventKind
from rt_robot_os.messages.cause import Level

#: The channel of the robot's own voice.
ROBOT: Final = 'robot'
STEPS_MOST: Final = 8
_CHANNELS_MOST: Final = 4
_LONGEST_S: Final = 86_400
_SHORTEST_REPEAT_S: Final = 1
_CHANNEL: Final = re.compile(r'[a-z][a-z0-9_-]{0,31}', re.ASCII)


class EscalationStep(NamedTuple):
    """
    One step of an escalation.

    :ivar channels: that are notified together.
    :ivar wait_ns: until the next step; of the last step until it repeats.
    :ivar repeat_ns: period of repetitions within the step; 0 for none.
    """

    channels: tuple[str, ...]
    wait_ns: int
    repeat_ns: int = 0


class EscalationListener(Protocol):
    """Receives what an escalation does."""

    def note(self, alarm: Alarm, event: AlarmEventKind, t_ns: int, *, by: str = '',
             why: str = '') -> None:
        """Record an event."""

    def send(self, alarm: Alarm, delivery: Delivery) -> None:
        """Queue a notification."""


def parse_steps(texts: Iterable[str]) -> tuple[EscalationStep, ...]:
    """
    Parse steps such as ``operator+screen 30 repeat 10``.

    Channels, the seconds until the next step, and the period in seconds at which the step repeats
    meanwhile. The last step repeats until the alarm is acknowledged.

    :raises ValueError: with what is wrong, and an example.
    """
    steps = []
    for text in texts:
        words = text.split()
        if len(words) not in (2, 4) or (len(words) == 4 and words[2] != 'repeat'):
            raise ValueError(f'{text[:60]!r} is not a step: write channels and seconds until the '
                             'next step, such as "operator 30" or "operator+screen 30 repeat 10"')
        channels = tuple(words[0].split('+'))
        if len(channels) > _CHANNELS_MOST or len(set(channels)) != len(channels) or not all(
                map(_CHANNEL.fullmatch, channels)):
            raise ValueError(f'{words[0][:60]!r} in {text[:60]!r}: it must be 1 to '
                             f'{_CHANNELS_MOST} different channels of small letters, such as '
                             'operator+screen')
        steps.append(EscalationStep(channels, _ns(text, words[1], 0), _ns(
            text, words[3], _SHORTEST_REPEAT_S) if len(words) == 4 else 0))
    if len(steps) > STEPS_MOST:
        raise ValueError(f'{len(steps)} steps: at most {STEPS_MOST}')
    if steps and not steps[-1].repeat_ns and steps[-1].wait_ns < _SHORTEST_REPEAT_S * NS_PER_S:
        raise ValueError(f'the last step, {"+".join(steps[-1].channels)!r}, repeats until '
                         'the alarm is acknowledged: give it at least 1 second')
    return tuple(steps)


def _ns(text: str, word: str, least: int) -> int:
    try:
        seconds = float(word)
    except ValueError:
        seconds = -1.0
    if not least <= seconds <= _LONGEST_S:
        raise ValueError(f'{word[:20]!r} in {text[:60]!r}: it must be a number of seconds from '
                         f'{least} to {_LONGEST_S}')
    return round(seconds * NS_PER_S)


class Escalation:
    """
    The escalation of all alarms.

    :param steps: by level.
    :param listener: receives events and notifications.
    :ivar floor_ns: when the core started; repetitions missed before it are not made up for.
    :ivar life: ends all keys that it makes. Notifications that were sent while the disk was full
        are not known after a restart, and their keys must not be made again.
    """

    def __init__(self, steps: Mapping[Level, tuple[EscalationStep, ...]], delivery_timeout_ns: int,
                 listener: EscalationListener) -> None:
        self._steps = steps
        self._timeout_ns = delivery_timeout_ns
        self._listener = listener
        self.floor_ns = 0
        self.life = ''

    def steps_of(self, alarm: Alarm) -> tuple[EscalationStep, ...]:
        """Return the steps of an alarm's level."""
        return self._steps.get(alarm.level, ())

    def begin(self, alarm: Alarm, t_ns: int) -> None:
        """Start at the first step, as a new round."""
        self.stop(alarm)
        alarm.round += 1
        alarm.step, alarm.top = -1, False
        alarm.deliveries.clear()
        self._next_step(alarm, t_ns)

    def stop(self, alarm: Alarm) -> None:
        """Stop notifications and deadlines."""
        alarm.next_ns = alarm.repeat_ns = 0
        for each in alarm.deliveries.values():
            each.due_ns = 0

    def due_ns(self, alarm: Alarm) -> int:
        """Return when :meth:`advance` has something to do next; 0 never."""
        found = [each.due_ns for each in alarm.deliveries.values() if each.due_ns]
        found += [each for each in (alarm.next_ns, alarm.repeat_ns) if each]
        return min(found, default=0)

    def advance(self, alarm: Alarm, t_ns: int) -> None:
        """Do what is due, at the time that :meth:`due_ns` gave."""
        for each in list(alarm.deliveries.values()):
            if each.due_ns and each.due_ns <= t_ns:
                self._failed(alarm, each, 'no report', t_ns)
                return
        if alarm.next_ns and alarm.next_ns <= t_ns:
            self._next_step(alarm, t_ns)
        elif alarm.repeat_ns and alarm.repeat_ns <= t_ns:
            self.repeat(alarm, t_ns)
            alarm.repeat_ns = self._repeat_ns(alarm, t_ns)

    def escalate_now(self, alarm: Alarm, t_ns: int) -> None:
        """Notify the next step immediately; at the last step repeat it."""
        if not alarm.top:
            self._next_step(alarm, t_ns)
        elif alarm.repeat_ns:
            self.repeat(alarm, t_ns)
            alarm.repeat_ns = self._repeat_ns(alarm, t_ns)

    def report(self, alarm: Alarm, delivery: Delivery, ok: bool, text: str, t_ns: int) -> None:
        """Apply a delivery report; the first success of each notification counts."""
        if delivery.ok or (delivery.ok is False and not ok):
            return
        if not ok:
            self._failed(alarm, delivery, text, t_ns)
            return
        delivery.ok, delivery.due_ns = True, 0
        self._listener.note(alarm, AlarmEventKind.DELIVERED, t_ns, why=_about(delivery, text))

    def repeat(self, alarm: Alarm, t_ns: int) -> None:
        """Notify the channels of the present step again; at the top also those that failed."""
        steps = self.steps_of(alarm)
        if not 0 <= alarm.step < len(steps):
            return
        channels = dict.fromkeys(steps[alarm.step].channels)
        if alarm.top:
            delivered = {each.channel for each in alarm.deliveries.values() if each.ok}
            channels |= dict.fromkeys(each.channel for each in alarm.deliveries.values()
                                      if each.ok is False and each.channel not in delivered)
        self._send(alarm, tuple(channels), t_ns, AlarmEventKind.REPEATED)

    def resume(self, alarm: Alarm, t_ns: int) -> None:
        """Continue after a restart: send again, under its key, what has no report yet."""
        for each in alarm.deliveries.values():
            if each.due_ns:
                each.due_ns, each.again = t_ns + self._timeout_ns, True
                self._listener.send(alarm, each)
        if not 0 <= alarm.step < len(self.steps_of(alarm)):
            self.begin(alarm, t_ns)  # the settings have other steps than before
        elif alarm.repeat_ns and alarm.repeat_ns < t_ns:
            alarm.repeat_ns = self._repeat_ns(alarm, alarm.repeat_ns)

    def _next_step(self, alarm: Alarm, t_ns: int) -> None:
        """Notify the next step, together with those that follow without a wait."""
        steps = self.steps_of(alarm)
        while alarm.step + 1 < len(steps):
            alarm.step += 1
            alarm.sent = 0
            step = steps[alarm.step]
            alarm.next_ns, alarm.repeat_ns = t_ns + step.wait_ns, 0
            last = alarm.step + 1 == len(steps)
            if last:
                alarm.next_ns = 0
            if last or step.repeat_ns:
                alarm.repeat_ns = self._repeat_ns(alarm, t_ns)
            self._send(alarm, step.channels, t_ns,
                       AlarmEventKind.ESCALATED if alarm.step else AlarmEventKind.NOTIFIED)
            if last and not alarm.top:
                alarm.top = True
                self._listener.note(alarm, AlarmEventKind.TOP, t_ns,
                                    why='there is nobody else to be told')
            if last or step.wait_ns:
                return

    def _repeat_ns(self, alarm: Alarm, t_ns: int) -> int:
        """Return when the present step repeats, which was notified at ``t_ns``."""
        step = self.steps_of(alarm)[alarm.step]
        period_ns = max(step.repeat_ns or step.wait_ns, _SHORTEST_REPEAT_S * NS_PER_S)
        return t_ns + period_ns * max(1, -((t_ns - self.floor_ns) // period_ns))

    def _send(self, alarm: Alarm, channels: tuple[str, ...], t_ns: int,
              event: AlarmEventKind) -> None:
        step = alarm.step
        # These replace the notifications of this step so far. A channel that has not reported yet
        # gets no more time by being notified again.
        before = {each.channel: alarm.deliveries.pop(key)
                  for key, each in list(alarm.deliveries.items()) if each.step == step}
        for channel in channels:
            key = f'{alarm.id}.{alarm.round}.{step}.{alarm.sent}.{channel}'
            key += f'.{self.life}' if self.life else ''
            due_ns = before[channel].due_ns if channel in before else 0
            alarm.deliveries[key] = Delivery(key, channel, step, due_ns or (
                max(t_ns, self.floor_ns) + self._timeout_ns))
            self._listener.send(alarm, alarm.deliveries[key])
        alarm.sent += 1
        self._listener.note(alarm, event, t_ns, why=', '.join(channels))

    def _failed(self, alarm: Alarm, delivery: Delivery, text: str, t_ns: int) -> None:
        delivery.ok, delivery.due_ns = False, 0
        self._listener.note(alarm, AlarmEventKind.FAILED, t_ns, why=_about(delivery, text))
        if not alarm.next_ns or delivery.step != alarm.step:
            return  # the last step, which repeats, or one that has ended
        if all(each.ok is False for each in alarm.deliveries.values()
               if each.step == alarm.step):
            self._next_step(alarm, t_ns)


def _about(delivery: Delivery, text: str) -> str:
    return f'{delivery.channel}: {text[:80]}' if text else delivery.channel
