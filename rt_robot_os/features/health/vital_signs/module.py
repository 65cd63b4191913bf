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
Vital signs of a person, combined from several sensors.

Of each sign the most preferred sensor with a value counts. The topic of a sign has plausible
values with the time of their measurement; the topic ``signs`` has their quality, age and source.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import json
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.vital_signs.sensor import IMPLAUSIBLE
from rt_robot_os.features.health.vital_signs.sensor import SignSensor
from rt_robot_os.features.health.vital_signs.settings import check_rate
from rt_robot_os.features.health.vital_signs.settings import checked_person
from rt_robot_os.features.health.vital_signs.settings import parse_sources
from rt_robot_os.features.health.vital_signs.settings import parse_timeouts
from rt_robot_os.features.health.vital_signs.settings import SensorSpec
from rt_robot_os.features.health.vital_signs.settings import SETTINGS
from rt_robot_os.features.health.vital_signs.sign_watch import GOOD
from rt_robot_os.features.health.vital_signs.sign_watch import MISSING
from rt_robot_os.features.health.vital_signs.sign_watch import SignReading
from rt_robot_os.features.health.vital_signs.sign_watch import SignWatch
from rt_robot_os.features.health.vital_signs.sign_watch import STALE
from rt_robot_os.kernel import Task
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.quantities import FLOAT
from rt_robot_os.messages.quantities import QUANTITIES
from rt_robot_os.messages.signs import SIGNS
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.cause_reports import CauseReports
from rt_robot_os.modules.cause_reports import CAUSES_OUTPUT
from rt_robot_os.modules.wake_up import WakeUp
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription
from rt_robot_os.topics.ports import Input

#: Topic of all signs of a person.
SIGNS_TOPIC: Final = 'health/{}/signs'
_STRING: Final = 'std_msgs/msg/String'
_SIGNS_BYTES: Final = 6000
_ROUND_NS: Final = NS_PER_S
_OK, _WARN, _STALE = 0, 1, 3
_COUNTERS: Final = ('readings', 'said_off', 'implausible', 'jumped', 'late')
SENSOR_OFF: Final = 'sensor_off'
SENSOR_IMPLAUSIBLE: Final = 'sensor_implausible'


class VitalSigns(Module):
    """Publish the vital signs of one person, and report sensors that are off."""

    causes = CAUSES_OUTPUT

    SETTINGS = SETTINGS

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Parse the sensors.

        :raises ConfigError: a setting cannot be parsed.
        """
        super().__init__(name, settings)
        self._person = checked_person(name, settings)
        self._texts = parse_sources(name, settings)
        self._times = parse_timeouts(name, settings)
        self._watches: dict[str, SignWatch] = {}
        self._readers: dict[str, list[tuple[Callable[[], float], SignWatch, int]]] = {}
        self._outputs: dict[str, Callable[[float, int], None]] = {}
        self._published: dict[str, tuple[str, int]] = {}
        self._next_ns = self._time_ns = -1
        self._said = 0

    # ---- ports -------------------------------------------------------------------------------

    def listed_inputs(self) -> Mapping[str, Input]:
        """Return an input for each topic of a sensor."""
        return {each.topic: Input(each.topic, wake=True)
                for sensors in self._texts.values() for each in sensors}

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return a topic for each sign, one for all of them, and that of the causes."""
        return (*(TopicSpec(
            self._topic_of(sign), QUANTITIES[sign].message,
            {} if QUANTITIES[sign].message == FLOAT else {'header.frame_id': self._person})
            for sign in self._texts),
            TopicSpec(SIGNS_TOPIC.format(self._person), _STRING, depth=16, tail=_SIGNS_BYTES),
            *super().publications())

    def bind(self, bus: Bus, task: Task) -> None:
        """Connect the topics of the settings."""
        super().bind(bus, task)
        self._signs = bus.publisher(SIGNS_TOPIC.format(self._person), task)
        self._outputs = {sign: _writer(bus.publisher(self._topic_of(sign), task),
                                       QUANTITIES[sign].field) for sign in self._texts}

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """
        Prepare the sensors; their timeouts start here.

        :raises ConfigError: the module has no rate, so no timeout would release it.
        """
        check_rate(self.name, self.period_ns)
        now_ns = self._signs.topic.kernel.now_ns()
        self._reports = CauseReports(self.causes, self.name)
        self._wake_up = WakeUp(self.kernel, self.task)
        for sign, sensors in self._texts.items():
            watch = SignWatch(SIGNS[sign], [
                SignSensor(SIGNS[sign], each.name, self._times[sign], now_ns)
                for each in sensors])
            self._watches[sign] = watch
            for place, each in enumerate(sensors):
                self._readers.setdefault(each.topic, []).append(
                    (_reader(self.name, each, self.listed[each.topic]), watch, place))
        self._time_ns, self._next_ns = now_ns, now_ns

    def step(self) -> None:
        """Process new samples in the order of their stamps, and deadlines."""
        now_ns = self._signs.topic.kernel.now_ns()
        is_news = False
        for stamp_ns, value, watch, place in self._arrived(now_ns):
            is_news |= self._advance(stamp_ns - 1)
            self._time_ns = max(self._time_ns, stamp_ns)
            watch.update(place, value, stamp_ns)
            is_news = True
        is_news |= self._advance(now_ns)
        if now_ns >= self._next_ns:
            # On whole seconds, whenever the module is released.
            self._time_ns = max(self._time_ns, now_ns - now_ns % _ROUND_NS)
            self._next_ns = now_ns - now_ns % _ROUND_NS + _ROUND_NS
            is_news = True
        if is_news:
            self._publish(self._time_ns)
        self._reports.refresh(now_ns)
        self._wake_up.no_later_than(min(self._next_ns, self._due_ns(), self._reports.due_ns))

    def statistics(self) -> Mapping[str, Any]:
        """Return counters of the sensors, and which are off."""
        found: dict[str, Any] = {'person': self._person, 'warning': '; '.join(
            f'{self._name(watch, source)} is {source.trouble}'
            for watch, source in self._all() if source.trouble)}
        found.update({name: sum(each[name] for each in self.counters()) for name in _COUNTERS})
        return {**found, **self._reports.statistics(), 'sensors': len(self._all()),
                'readings_lost': sum(read.lost for read in self.listed.values())}

    def counters(self) -> list[dict[str, int]]:
        """Return counters of each sensor: by sign, and within one as the settings list them."""
        return [{name: getattr(source, name) for name in _COUNTERS} for _, source in self._all()]

    # ---- work --------------------------------------------------------------------------------

    def _topic_of(self, sign: str) -> str:
        return f'health/{self._person}/{sign}'

    def _all(self) -> list[tuple[SignWatch, SignSensor]]:
        return [(watch, source) for watch in self._watches.values() for source in watch.sources]

    @staticmethod
    def _name(watch: SignWatch, source: SignSensor) -> str:
        return f'{watch.sign.title} of {source.name}'

    def _arrived(self, now_ns: int) -> list[tuple[int, float, SignWatch, int]]:
        """Return the new samples, by their stamps."""
        found = []
        for topic, read in self.listed.items():
            readers = self._readers[topic]
            while read.take():
                found += [(min(read.stamp_ns, now_ns), get(), watch, place)
                          for get, watch, place in readers]
        found.sort(key=lambda each: each[0])
        return found

    def _due_ns(self) -> float:
        return min(watch.due_ns for watch in self._watches.values())

    def _advance(self, until_ns: int) -> bool:
        """Process the deadlines until a time, in order; return whether there was one."""
        passed = False
        while (due_ns := self._due_ns()) <= until_ns:
            self._time_ns = max(self._time_ns, int(due_ns))
            for watch in self._watches.values():
                was_contradicted = watch.is_contradicted
                for source, _ in watch.advance(int(due_ns)):
                    self._report_sensor(source.name, int(due_ns))
                if watch.is_contradicted != was_contradicted:
                    self._report_contradiction(watch, int(due_ns))
            passed = True
        return passed

    def _report_sensor(self, name: str, stamp_ns: int) -> None:
        """Report the state of a sensor, with all its signs."""
        troubles: dict[str, list[tuple[SignWatch, SignSensor]]] = {
            SENSOR_OFF: [], SENSOR_IMPLAUSIBLE: []}
        for watch, source in self._all():
            if source.name == name and source.trouble:
                kind = SENSOR_IMPLAUSIBLE if source.trouble == IMPLAUSIBLE else SENSOR_OFF
                troubles[kind].append((watch, source))
        for kind, found in troubles.items():
            if not found:
                self._reports.end(kind, name, stamp_ns, f'{name} of {self._person} measures again')
                continue
            what = ', '.join(f'{watch.sign.title} {source.trouble}' for watch, source in found)
            self._reports.report(Cause(kind, name, Level.TECHNICAL, text=(
                f'{name} of {self._person} measures nothing: {what}'), node=name), stamp_ns)

    def _report_contradiction(self, watch: SignWatch, stamp_ns: int) -> None:
        names = ' and '.join(source.name for source in watch.sources)
        self._reports.report(Cause(
            SENSOR_IMPLAUSIBLE, f'{self._person} {watch.sign.title}', Level.TECHNICAL,
            watch.is_contradicted, f'{watch.sign.title} of {self._person}: {names} contradict '
            'each other'), stamp_ns)

    def _publish(self, time_ns: int) -> None:
        readings = {sign: watch.reading(time_ns) for sign, watch in self._watches.items()}
        for sign, reading in readings.items():
            mark = reading.source, reading.stamp_ns
            if reading.stamp_ns >= 0 and self._published.get(sign) != mark:
                self._published[sign] = mark
                self._outputs[sign](reading.value, reading.stamp_ns)
        self._signs.msg.data = signs_text(self._person, readings, time_ns)
        self._signs.publish(time_ns)


def signs_text(person: str, readings: Mapping[str, SignReading], time_ns: int) -> str:
    """Return signs as a DiagnosticArray in JSON; safe in the real-time loop."""
    status = []
    for name, reading in readings.items():
        sign = SIGNS[name]
        known = reading.stamp_ns >= 0
        age_s = (time_ns - reading.stamp_ns) / NS_PER_S
        values = {'value': f'{reading.value:g}' if known else '', 'unit': sign.unit,
                  'quality': reading.quality, 'age_s': f'{age_s:.1f}' if known else '',
                  'source': reading.source, 'stamp_ns': str(reading.stamp_ns) if known else ''}
        said = f'{reading.value:g} {sign.unit}'.strip()
        level = {GOOD: _OK, STALE: _STALE, MISSING: _STALE}.get(reading.quality, _WARN)
        status.append({
            'level': level, 'name': f'{person}/{name}',
            'message': said if reading.quality == GOOD else (
                f'{reading.quality}, last {said}' if known else reading.quality),
            'hardware_id': reading.source, 'values': values})
    return json.dumps({'status': status}, separators=(',', ':'))


def _writer(publisher: Publisher, field: str) -> Callable[[float, int], None]:
    message, publish = publisher.msg, publisher.publish

    def write(value: float, stamp_ns: int) -> None:
        setattr(message, field, value)
        publish(stamp_ns)
    return write


def _reader(name: str, source: SensorSpec, read: Subscription) -> Callable[[], float]:
    """Return a function that reads the number of the newest message."""
    kind = read.topic.layout.type_name
    by_type = {each.message: each.field for each in QUANTITIES.values()}
    *inner, last = (source.field or by_type.get(kind, 'data')).split('.')
    try:
        found = read.msg
        for each in inner:
            found = getattr(found, each)
        value = getattr(found, last)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise AttributeError(f'it is a {type(value).__name__}')
    except AttributeError as error:
        raise ConfigError([
            f'{name}.sources: {source.topic!r} is a {kind} without a number '
            f'{".".join((*inner, last))} ({error}): write SIGN TOPIC.FIELD']) from None

    def number() -> float:
        return float(getattr(found, last))
    return number
