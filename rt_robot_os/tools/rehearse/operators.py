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

"""People in scenarios: a caregiver who is notified, an operator, and callers by other programs."""

from __future__ import annotations

from collections import Counter
from functools import partial
import json
import math
from random import Random
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.journal_store import MemoryStore
from rt_robot_os.features.alarms.scenarios.notifier_process import NotifierProcess
from rt_robot_os.features.alarms.scenarios.notifier_process import Recipient
from rt_robot_os.messages.notification import DeliveryReport
from rt_robot_os.messages.notification import Notification
from rt_robot_os.sim.scenarios.timeline import seconds
from rt_robot_os.sim.scenarios.timeline import VirtualTimeline
from rt_robot_os.tools.rehearse.fixture import CoreFixture
from rt_robot_os.tools.rehearse.scenario import CALLERS
from rt_robot_os.tools.rehearse.scenario import CaregiverProfile
from rt_robot_os.tools.rehearse.simulated_robot import SimulatedRobot
from rt_robot_os.tools.rehearse.topics import publish_text
from rt_robot_os.tools.rehearse.topics import received
from rt_robot_os.topics import Publisher

#: The name under which the caregiver acknowledges and resolves.
CAREGIVER: Final = 'carer'
_BEAT_NS: Final = 5 * NS_PER_S
# Period at which an active call is published again.
_REPEAT_NS: Final = 10 * NS_PER_S


class _Recipients(dict[str, Recipient]):
    """The recipients of channels; a channel is added at its first notification."""

    def __missing__(self, channel: str) -> Recipient:
        made = self[channel] = Recipient(channel)
        return made


class NotifierAndCaregiver:
    """
    Simulates the program ``notifier``, and the caregiver who reads its messages.

    :param profile: how quickly the caregiver reacts.
    :ivar failing: all channels fail.
    """

    def __init__(self, profile: CaregiverProfile, random: Random) -> None:
        self.failing = False
        self._profile = profile
        self._timeline = VirtualTimeline()
        self._recipients = _Recipients()
        self._notifier = NotifierProcess(self._timeline, random, MemoryStore(), self._recipients,
                                         self._report, self._read)
        self._busy: set[str] = set()

    @property
    def shown(self) -> Counter[str]:
        """Return how often each notification was shown to a person, by its key."""
        found: Counter[str] = Counter()
        for recipient in self._recipients.values():
            found += recipient.shown
        return found

    def attach(self, fixture: CoreFixture) -> None:
        """Find the topics; notifier and caregiver continue after a crash of the core."""
        self._messages = fixture.reader('alarms/notify')
        self._reports = fixture.publisher('alarms/report')
        self._commands = fixture.publisher('alarms/command')
        self._beats = fixture.publisher('notifier/heartbeat')

    def step(self, now_ns: int) -> None:
        """Deliver messages, and execute due actions."""
        if now_ns % _BEAT_NS == 0:
            publish_text(self._beats, '{}', now_ns)
        self._timeline.now_ns = now_ns
        for message in received(self._messages):
            self._recipients[Notification.from_json(message).channel].down = self.failing
            self._notifier.receive(message, now_ns)
        for recipient in self._recipients.values():
            recipient.down = self.failing
        self._timeline.run_until(now_ns)

    def _report(self, report: DeliveryReport) -> None:
        publish_text(self._reports, report.to_json(), self._timeline.now_ns)

    def _read(self, recipient: Recipient, message: Notification) -> None:
        alarm = message.alarm
        if alarm in self._busy or not math.isfinite(self._profile.reads_after_s):
            return
        self._busy.add(alarm)
        self._timeline.after(seconds(self._profile.reads_after_s),
                             partial(self._acknowledge, alarm))

    def _acknowledge(self, alarm: str) -> None:
        self._command(f'acknowledge {alarm} by {CAREGIVER}')
        self._timeline.after(seconds(self._profile.ends_after_s), partial(self._resolve, alarm))

    def _resolve(self, alarm: str) -> None:
        self._command(f'resolve {alarm} by {CAREGIVER} looked after')
        self._busy.discard(alarm)  # a later notification is acknowledged again

    def _command(self, text: str) -> None:
        publish_text(self._commands, text, self._timeline.now_ns)


class SimulatedOperator:
    """
    Simulates an operator, and another program that publishes calls.

    :param robot: the robot that the operator sends to other goals.
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        self._robot = robot
        self._texts: dict[str, Publisher | None] = {}
        self._calls: dict[str, int] = {}

    def attach(self, fixture: CoreFixture) -> None:
        """Find the topics."""
        self._texts = {topic: fixture.publisher(topic)
                       for topic in ('agent/command', 'alarms/causes')}
        self._goal = fixture.publisher('goal_pose')

    def step(self, now_ns: int) -> None:
        """Publish active calls again."""
        for caller, until_ns in self._calls.items():
            if now_ns % _REPEAT_NS == 0 and now_ns < until_ns:
                self._call(caller, True, now_ns)

    def command(self, words: str, now_ns: int) -> None:
        """Send a command to the agent."""
        publish_text(self._texts['agent/command'], words, now_ns)

    def send(self, x: float, y: float, now_ns: int) -> None:
        """Send the robot to another goal."""
        if self._goal is not None:
            self._robot.errand = x, y
            self._goal.msg.pose.position = x, y, 0.0
            self._goal.msg.pose.orientation = 0.0, 0.0, 0.0, 1.0
            self._goal.publish(now_ns)

    def call(self, caller: str, for_ns: int, now_ns: int) -> None:
        """Publish a call of another program, for its duration."""
        self._calls[caller] = now_ns + for_ns
        self._call(caller, True, now_ns)

    def hang_up(self, caller: str, now_ns: int) -> None:
        """End a call."""
        self._call(caller, False, now_ns)

    def _call(self, caller: str, active: bool, now_ns: int) -> None:
        place = CALLERS[caller]
        publish_text(self._texts['alarms/causes'], json.dumps({
            'kind': 'call', 'subject': caller, 'level': 'urgent', 'active': active,
            'text': f'a call from the {caller}', 'source': 'calls',
            **({} if place is None else {'x': place[0], 'y': place[1]})}), now_ns)
