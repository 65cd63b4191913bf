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
Observations on order: pictures and clips of cameras, and the sound level.

An order goes to every listed camera, and each reply is published as one answer. If a camera does
not reply in time, the module publishes an answer with a problem, so that each order is answered.
With a microphone each answer has the sound level.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import json
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.agent.observer.levels import Levels
from rt_robot_os.features.agent.observer.levels import Loudness
from rt_robot_os.messages.agent import Observation
from rt_robot_os.messages.agent import ObservationKind
from rt_robot_os.messages.agent import ObservationOrder
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.wake_up import WakeUp
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_TEXT: Final = 'std_msgs/msg/String'
_ORDER_BYTES: Final = 800
_OBSERVED_BYTES: Final = 2400
_OPEN_MOST: Final = 32
# Period of the sound level of a picture, which itself takes no time.
_AROUND_NS: Final = 2 * NS_PER_S


@dataclass
class _OpenOrder:
    """An order without all its answers."""

    number: int
    order: ObservationOrder
    from_ns: int
    until_ns: int
    due_ns: int
    #: Cameras without a reply yet, by the topics of their replies.
    waits_for: set[str]


class Observer(Module):
    """Order pictures and clips of the cameras, and publish the sound level."""

    order = Input('agent/observe', wake=True, message=_TEXT)
    level = Input('', message='std_msgs/msg/Float32')
    camera_order = Output('camera/observe', _TEXT, tail=_ORDER_BYTES, depth=16)
    observed = Output('agent/observed', _TEXT, tail=_OBSERVED_BYTES, depth=16)

    SETTINGS = (
        Field('observed_topics', list, ['camera/observed'], 'Topics of the replies of the '
              'cameras (their setting observed_topic); empty: there is no camera'),
        Field('timeout_s', float, 8.0, 'Time-out of a camera after the end of an '
              'observation', 's', 0.5, 120.0),
        Field('level_topic', str, '', 'Level of a microphone, in dB below full scale, such as '
              'sound/level; empty: none. It needs a rate_hz, so that none is overwritten'),
        Field('sound_s', float, 30.0, 'How long levels are stored', 's', 1.0, 120.0),
    )

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Check the settings.

        :raises ConfigError: there is nothing to observe with.
        """
        super().__init__(name, settings)
        if not settings['observed_topics'] and not settings['level_topic']:
            raise ConfigError([f'{name}: neither observed_topics nor level_topic is set: there '
                               'is nothing to observe with'])
        self._levels = Levels(settings['sound_s'])
        self._open: list[_OpenOrder] = []
        self._number = 0
        self._orders = self._refused = self._answers = self._problems = self._unanswered = 0
        self._unreadable = 0
        self._problem = ''

    # ---- ports -------------------------------------------------------------------------------

    def connected(self, attribute: str) -> bool:
        """Return whether a port has a topic."""
        if attribute == 'camera_order' and not self.settings['observed_topics']:
            return False
        return bool(self.topic_of(attribute))

    def listed_inputs(self) -> Mapping[str, Input]:
        """Return an input for each camera."""
        return {topic: Input(topic, wake=True, message=_TEXT)
                for topic in self.settings['observed_topics']}

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """Prepare."""
        self._wake_up = WakeUp(self.kernel, self.task)

    def step(self) -> None:
        """Read levels, orders and replies, and check time-outs."""
        now_ns = self.observed.topic.kernel.now_ns()
        if self.connected('level'):
            while self.level.take():
                self._levels.add(self.level.stamp_ns, float(self.level.msg.data))
        while self.order.take():
            self._take_order(str(self.order.msg.data), self.order.stamp_ns)
        for topic, reply in self.listed.items():
            while reply.take():
                self._take_answer(topic, str(reply.msg.data), reply.stamp_ns)
        for one in [each for each in self._open if each.due_ns <= now_ns]:
            self._end(one)
        self._wake_up.no_later_than(min((each.due_ns for each in self._open), default=math.inf))

    def statistics(self) -> Mapping[str, Any]:
        """Return the counters of orders and answers."""
        return {'warning': self._problem, 'orders': self._orders, 'orders_refused': self._refused,
                'answers': self._answers, 'problems': self._problems,
                'unanswered': self._unanswered, 'unreadable': self._unreadable,
                'open': len(self._open),
                'levels_lost': self.level.lost if self.connected('level') else 0}

    # ---- orders ------------------------------------------------------------------------------

    def _take_order(self, text: str, stamp_ns: int) -> None:
        self._orders += 1
        try:
            order = ObservationOrder.from_json(text)
        except ValueError as error:
            self._refused += 1
            self._answer(Observation('', '', '', problem=str(error)).to_dict(), stamp_ns)
            return
        self._number += 1
        kind = order.order
        until_ns = stamp_ns + round(order.after_s * NS_PER_S)
        one = _OpenOrder(self._number, order, stamp_ns - round(order.before_s * NS_PER_S),
                         until_ns, until_ns, set())
        if kind is ObservationKind.PICTURE:
            one.from_ns, one.until_ns = stamp_ns - _AROUND_NS, stamp_ns
        problem = self._cannot(kind)
        if problem:
            self._answer(_observation(one, problem=problem).to_dict(), stamp_ns)
            return
        if len(self._open) >= _OPEN_MOST:
            self._refused += 1
            self._answer(_observation(one, problem=(
                f'{_OPEN_MOST} orders are open already')).to_dict(), stamp_ns)
            return
        self._open.append(one)
        if kind is not ObservationKind.SOUND:
            one.waits_for = set(self.listed)
            if kind is ObservationKind.PICTURE:
                one.due_ns = stamp_ns
            one.due_ns += round(self.settings['timeout_s'] * NS_PER_S)
            self.camera_order.msg.data = json.dumps({'id': one.number, **order.to_dict()})
            self.camera_order.publish(stamp_ns)

    def _cannot(self, kind: ObservationKind) -> str:
        if kind is ObservationKind.SOUND:
            return '' if self.connected('level') else 'there is no microphone (level_topic)'
        return '' if self.listed else 'there is no camera (observed_topics)'

    # ---- answers -----------------------------------------------------------------------------

    def _take_answer(self, topic: str, text: str, stamp_ns: int) -> None:
        try:
            reply = json.loads(text)
            number = reply.get('id', 0)
        except (ValueError, AttributeError, RecursionError):
            self._unreadable += 1
            return
        one = next((each for each in self._open if each.number == number), None)
        if one is None or topic not in one.waits_for:
            self._unreadable += 1  # timed out, or not an order of this module
            return
        one.waits_for.discard(topic)
        if not one.waits_for:
            self._open.remove(one)
        reply = {key: value for key, value in reply.items() if key != 'id'}
        # Unmodified but for what the order says: a camera may add fields of its own.
        self._answer({**reply, **_observation(one).to_dict(), **self._loudness(one)}, stamp_ns)

    def _end(self, one: _OpenOrder) -> None:
        """Answer for the cameras that have not."""
        self._open.remove(one)
        if one.order.order is ObservationKind.SOUND:
            loudness = self._levels.between(one.from_ns, one.until_ns)
            if loudness is None:
                found = _observation(one, problem=(
                    f'{self.topic_of("level")} has said nothing: is the microphone there?'))
            else:
                found = _observation(one, text=_sound_text(loudness, one), t_ns=one.until_ns,
                                     **_sound(loudness))
            self._answer(found.to_dict(), one.due_ns)
            return
        for topic in sorted(one.waits_for):
            self._unanswered += 1
            found = _observation(one, **self._loudness(one), problem=(
                f'{topic} has not answered for {self.settings["timeout_s"]:g} s: look whether '
                'the camera is there'))
            self._answer(found.to_dict(), one.due_ns)

    def _loudness(self, one: _OpenOrder) -> dict[str, Any]:
        loudness = self._levels.between(one.from_ns, one.until_ns)
        return {} if loudness is None else _sound(loudness)

    def _answer(self, reply: Mapping[str, Any], stamp_ns: int) -> None:
        problem = str(reply.get('problem', ''))
        self._answers += 1
        self._problems += bool(problem)
        self._problem = problem
        if problem:
            self.log.warn('%s', problem, throttle_s=1.0)
        text = json.dumps({key: value for key, value in reply.items() if value != ''},
                          separators=(',', ':'))
        if len(text) > _OBSERVED_BYTES:
            text = json.dumps({'alarm': reply.get('alarm', ''), 'kind': reply.get('kind', ''),
                               'problem': 'the answer is too long'})
        self.observed.msg.data = text
        self.observed.publish(stamp_ns)


def _observation(one: _OpenOrder, **more: Any) -> Observation:
    order = one.order
    return Observation(order.alarm, order.subject, order.order.value, **more)


def _sound(loudness: Loudness) -> dict[str, Any]:
    return {'level_db': round(loudness.mean_db, 1), 'loudest_db': round(loudness.loudest_db, 1)}


def _sound_text(loudness: Loudness, one: _OpenOrder) -> str:
    lasts_s = (one.until_ns - one.from_ns) / NS_PER_S
    return (f'sound over {lasts_s:.0f} s: {loudness.mean_db:.0f} dB in the mean, '
            f'{loudness.loudest_db:.0f} dB at the loudest, of full scale')
