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
The topics of the robot that become records, and the importance of each.

Each sample of an event topic (alarms, the agent, speech) becomes a record, and the last recorded
position is stored with it on the disk: after a restart of the core or the gateway nothing is
recorded twice. A state topic becomes a record when it changes, and periodically.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import math
import time
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.gateway.convert import nodes_of
from rt_robot_os.gateway.convert import value_of
from rt_robot_os.gateway.outbox import Mark
from rt_robot_os.gateway.part import GatewayContext
from rt_robot_os.gateway.part import Part
from rt_robot_os.gateway.part import Record
from rt_robot_os.gateway.reading import Reads
from rt_robot_os.gateway.reading import Sample
from rt_robot_os.gateway.record_queue import RecordQueue
from rt_robot_os.gateway.robot_link import utc_of
from rt_robot_os.messages.cdr import labelled_numbers
from rt_robot_os.messages.cdr import string_in
from rt_robot_os.messages.diagnostic_array import statuses_of
from rt_robot_os.messages.texts.coded import codes_of
from rt_robot_os.messages.uplink.importance import Importance


class RecordTopic(NamedTuple):
    """
    A topic of which each sample is a record.

    :ivar type: type of the record.
    :ivar key: key of a text that is not JSON in the record.
    """

    topic: str
    importance: Importance
    type: str  # noqa: A003
    key: str = 'text'


EVENTS: Final = (
    RecordTopic('alarms/events', Importance.ALARM, 'alarm_event'),
    RecordTopic('agent/transitions', Importance.EVENT, 'transition'),
    RecordTopic('agent/say', Importance.EVENT, 'log', 'said'),
    RecordTopic('agent/observed', Importance.EVENT, 'log', 'observed'))
#: Texts of events that a page translates by their codes.
_WORDED: Final = ('text', 'why')
_SIGNS: Final = 'health/*/signs'
_SCORES: Final = 'health/*/news2_details'
_PLACES: Final = 'health/*/place_details'
_NODES: Final = 'wsn/nodes'
_FAULTS: Final = 'motor_faults'
_MOVED_M: Final = 0.3
_STATES_MOST: Final = 4096
_HZ_MOST: Final = 20.0


class Records(Part):
    """
    Make records of samples.

    :param keeper: the queue for the records.
    :ivar passed_over: samples that had been recorded before a restart.
    """

    def __init__(self, context: GatewayContext, keeper: RecordQueue) -> None:
        super().__init__(context)
        self.passed_over = 0
        self._keeper = keeper
        self._marks = keeper.marks()
        self._kinds = {each.topic: each for each in EVENTS}
        self._states: dict[tuple[str, ...], tuple[Any, float]] = {}
        self._measured: dict[tuple[str, ...], int] = {}  # last recorded stamps

    def reads(self) -> Sequence[Reads]:
        """Read all samples of events, and the newest of states."""
        settings = self.context.settings
        signs_hz = _HZ_MOST if not settings.signs_s else min(_HZ_MOST, 1 / settings.signs_s)
        return (*(Reads(each.topic, self._take_event, every=True) for each in EVENTS),
                Reads(_SIGNS, self._take_signs, rate_hz=signs_hz),
                Reads(_SCORES, self._take_score, rate_hz=signs_hz),
                Reads(_PLACES, self._take_place, rate_hz=1.0),
                Reads(_NODES, self._take_nodes, rate_hz=1.0),
                Reads(_FAULTS, self._take_faults, rate_hz=5.0))

    # ---- events ------------------------------------------------------------------------------

    def _take_event(self, sample: Sample) -> None:
        run = self.context.robot.run_id
        known = self._marks.get(sample.topic)
        if known is not None and known.run == run and sample.seq <= known.seq:
            self.passed_over += 1
            return
        mark = self._marks[sample.topic] = Mark(sample.topic, run, sample.seq)
        kind = self._kinds[sample.topic]
        value = value_of(sample.topic, sample.type, bytes(sample.cdr))
        content = dict(value) if isinstance(value, dict) else {kind.key: value}
        if (codes := codes_of(content, _WORDED)):
            content['codes'] = codes
        self._keeper.keep(Record(kind.importance, kind.type, content, utc_of(sample.stamp_ns)),
                          mark)

    # ---- what is -----------------------------------------------------------------------------

    def _take_signs(self, sample: Sample) -> None:
        person = sample.topic.split('/')[1]
        for each in statuses_of(string_in(sample.cdr)):
            sign = each.name.rpartition('/')[2]
            value, quality = _number(each.values.get('value')), each.values.get('quality', '')
            source = each.values.get('source', '')
            measured = _number(each.values.get('stamp_ns')) if quality == 'good' else None
            stamp_ns = sample.stamp_ns if measured is None else int(measured)
            key = ('sign', person, sign)
            # A cuff measures once an hour: its value stays valid, and is one observation.
            if measured is not None and self._measured.get(key) == stamp_ns:
                continue
            if not self._is_due(key, (value, quality, source),
                                self.context.settings.observation_s):
                continue
            self._measured[key] = stamp_ns
            self._keep(Importance.OBSERVATION, 'observation', {
                'person': person, 'sign': sign, 'value': value, 'quality': quality,
                'source': source}, stamp_ns)

    def _take_score(self, sample: Sample) -> None:
        person = sample.topic.split('/')[1]
        for each in statuses_of(string_in(sample.cdr)):
            total = _number(each.values.get('total'))
            content = {
                'person': person, 'sign': 'news2', 'value': total,
                'quality': 'missing' if total is None else 'good', 'source': 'assessment',
                'at_least': _number(each.values.get('at_least')),
                'missing': each.values.get('missing', ''), 'risk': each.values.get('risk', '')}
            if self._is_due(('news2', person), content, self.context.settings.observation_s):
                self._keep(Importance.OBSERVATION, 'news2', content, sample.stamp_ns)

    def _take_place(self, sample: Sample) -> None:
        person = sample.topic.split('/')[1]
        for each in statuses_of(string_in(sample.cdr)):
            x, y = _number(each.values.get('x')), _number(each.values.get('y'))
            room = each.values.get('room', '')
            key = ('place', person)
            known = self._states.get(key)
            moved = known is None or known[0][2] != room or _far((x, y), known[0][:2])
            least_s = self.context.settings.place_s
            now_s = time.monotonic()
            age_s = math.inf if known is None else now_s - known[1]
            if age_s >= (least_s if moved else self.context.settings.observation_s):
                self._remember(key, (x, y, room), now_s)
                self._keep(Importance.OBSERVATION, 'place', {
                    'person': person, 'x': x, 'y': y, 'room': room}, sample.stamp_ns)

    def _take_nodes(self, sample: Sample) -> None:
        for each in nodes_of(*labelled_numbers(memoryview(sample.cdr))):
            # A change of these is recorded immediately.
            state = each.state, each.parent
            if self._is_due(('node', each.name), state, self.context.settings.node_s):
                self._keep(Importance.NETWORK, 'node', each.to_record(), sample.stamp_ns)

    def _take_faults(self, sample: Sample) -> None:
        faults = value_of(sample.topic, sample.type, bytes(sample.cdr))
        known = self._states.get((_FAULTS,))
        if faults != (known[0] if known else 0):  # it begins without
            self._remember((_FAULTS,), faults, time.monotonic())
            self._keep(Importance.EVENT, 'log', {'what': _FAULTS, 'faults': faults},
                       sample.stamp_ns)

    def _is_due(self, key: tuple[str, ...], state: Any, every_s: float) -> bool:
        """Return whether a state has changed or is due again; store it if so."""
        now_s = time.monotonic()
        known = self._states.get(key)
        if known is not None and known[0] == state and now_s - known[1] < every_s:
            return False
        return self._remember(key, state, now_s)

    def _remember(self, key: tuple[str, ...], state: Any, now_s: float) -> bool:
        if key not in self._states and len(self._states) >= _STATES_MOST:
            return False
        self._states[key] = state, now_s
        return True

    def _keep(self, importance: Importance, kind: str, content: Mapping[str, Any], stamp_ns: int
              ) -> None:
        self._keeper.keep(Record(importance, kind, content, utc_of(stamp_ns)))

    def statistics(self) -> dict[str, Any]:
        """Return its counters."""
        return {'recorded_before': self.passed_over}


def _number(text: str | None) -> float | None:
    """Read a number of a diagnosis; None for none."""
    try:
        value = float(text or 'nan')
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _far(here: Sequence[float | None], there: Sequence[float | None]) -> bool:
    return any((a is None) != (b is None) or a is not None and b is not None
               and abs(a - b) > _MOVED_M for a, b in zip(here, there))
