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
Fall detection of one person with a worn inertial sensor: reports a cause, and its end.

The detector is that of :mod:`rt_robot_os.features.health.fall_detector.detector`, which
``health falls`` evaluates on recordings. All times are stamps of samples.
"""

from __future__ import annotations

from collections.abc import Mapping
import json
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2
from rt_robot_os.features.health.fall_detector.detector import DetectorState
from rt_robot_os.features.health.fall_detector.detector import Evidence
from rt_robot_os.features.health.fall_detector.detector import FallDetector
from rt_robot_os.features.health.fall_detector.detector import FallEvent
from rt_robot_os.features.health.fall_detector.detector import FallEventKind
from rt_robot_os.features.health.fall_detector.limits import FALL_FIELDS
from rt_robot_os.features.health.fall_detector.limits import limits_from_settings
from rt_robot_os.features.health.fall_detector.limits import limits_problem
from rt_robot_os.features.health.fall_detector.peak_watch import CONFIDENCE
from rt_robot_os.features.health.fall_detector.peak_watch import PeakLimits
from rt_robot_os.features.health.fall_detector.peak_watch import PeakWatch
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import Level
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.cause_reports import CauseReports
from rt_robot_os.modules.cause_reports import CAUSES_OUTPUT
from rt_robot_os.modules.wake_up import WakeUp
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_PERSON: Final = '{person}'
_KIND: Final = 'fall'
_STATE_BYTES: Final = 1200
_STATE_EVERY_NS: Final = 10 * NS_PER_S
# Below 18 Hz an impact may fall between two samples.
_LONGEST_STEP_NS: Final = NS_PER_S // 16
_PEAKS: Final = PeakLimits()
# Levels of diagnostic_msgs/msg/DiagnosticStatus.
_OK, _ERROR, _STALE = 0, 2, 3


class FallDetection(Module):
    """Report when a person falls, and when they have got up again."""

    imu = Input('health/{person}/imu', wake=True, message='sensor_msgs/msg/Imu')
    peaks = Input('', wake=True, message='std_msgs/msg/Float64')
    causes = CAUSES_OUTPUT
    state = Output('health/{person}/falls', 'std_msgs/msg/String', tail=_STATE_BYTES, depth=8)

    SETTINGS = (
        Field('person', str, REQUIRED, 'Pseudonym of the wearer of the sensor; replaces {person} '
              'in the names of the topics'),
        Field('node', str, '', 'The worn sensor node, for the alarm: the robot drives to its last '
              'position'),
        *FALL_FIELDS,
        Field('silent_s', float, 1.0, 'Time without samples after which an impact is evaluated '
              'with the samples so far: the sensor may have broken in a fall', 's', 0.3, 10.0),
        Field('peak_blow_g', float, _PEAKS.blow_g, 'For a node that reports peaks only '
              '(peaks_topic): least peak of an impact', 'g', 1.5, 100.0),
        Field('peak_moves_g', float, _PEAKS.moves_g, 'Least peak after the impact that shows a '
              'movement', 'g', 1.05, 10.0),
        Field('peak_quiet_s', float, _PEAKS.quiet_s, 'Time without movement after the impact '
              'after which a fall is suspected', 's', 1.0, 600.0),
    )

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Check that the settings are consistent.

        :raises ConfigError: they are not, or no input is set.
        """
        super().__init__(name, settings)
        self._limits = limits_from_settings(settings)
        problem = limits_problem(self._limits)
        if problem:
            raise ConfigError([f'{name}: {problem}'])
        person: str = settings['person']
        if not person.strip() or '/' in person:
            raise ConfigError([f'{name}.person {person!r}: must be a pseudonym that is valid in '
                               'the name of a topic, such as anna'])
        if not (self.connected('imu') or self.connected('peaks')):
            raise ConfigError([f'{name}: neither imu_topic nor peaks_topic is set: set one of '
                               'them to the topic of the sensor'])
        self._person = person
        self._silent_ns = round(settings['silent_s'] * NS_PER_S)
        self._falls = self._recoveries = self._without_acceleration = 0
        # Created here and not in activate(): a restart of the module must not end a fall.
        self._detector = FallDetector(self._limits)
        self._watch = PeakWatch(PeakLimits(
            settings['peak_blow_g'], settings['peak_moves_g'], settings['peak_quiet_s']))
        self._silent = True
        self._step_ns = 0.0
        # Of the newest sample or the last deadline; the stamp of all output.
        self._time_ns = 0
        self._published: tuple[Any, ...] = ()
        self._published_ns = 0

    # ---- ports -------------------------------------------------------------------------------

    def topic_of(self, attribute: str) -> str:
        """Return the topic of a port, with the person's name."""
        return super().topic_of(attribute).replace(_PERSON, str(self.settings['person']))

    def connected(self, attribute: str) -> bool:
        """Return whether a port has a topic."""
        return bool(self.topic_of(attribute))

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """Prepare the reports of causes."""
        self._reports = CauseReports(self.causes, self.name)
        self._wake_up = WakeUp(self.kernel, self.task)
        if self.connected('imu'):
            layout = self.imu.topic.layout
            self._unpack = layout.packer('angular_velocity', 'linear_acceleration').unpack
            self._covariance = self.imu.msg.linear_acceleration_covariance

    def step(self) -> None:
        """Process new samples and deadlines."""
        now_ns = self.state.topic.kernel.now_ns()
        if self.connected('imu'):
            self._read_samples(now_ns)
        if self.connected('peaks'):
            self._read_peaks(now_ns)
        self._reports.refresh(now_ns)
        self._publish_state(self._time_ns)
        self._wake_up.no_later_than(self._reports.due_ns)

    def statistics(self) -> Mapping[str, Any]:
        """Return counters, and a warning when falls cannot be detected."""
        detector = self._detector
        slow = self._step_ns > _LONGEST_STEP_NS
        warning = ''
        if self._without_acceleration:
            warning = f'samples of {self.topic_of("imu")} without an acceleration'
        elif self.connected('imu') and self._silent and detector.samples:
            warning = (f'no samples on {self.topic_of("imu")}: falls of {self._person} are not '
                       'detected')
        elif detector.state is DetectorState.TAKEN_OFF:
            warning = (f'the sensor of {self._person} does not move at all and is probably not '
                       'worn: falls are not detected until it is')
        elif slow:
            warning = (f'only {NS_PER_S / self._step_ns:.0f} samples a second: an impact may fall '
                       'between two of them; at least 18 are needed, 50 are better')
        return {'warning': warning, 'state': detector.state.value, 'falls': self._falls,
                'recoveries': self._recoveries, 'samples': detector.samples,
                'rejected': detector.rejected, 'out_of_order': detector.out_of_order,
                'without_acceleration': self._without_acceleration,
                'samples_lost': self.imu.lost if self.connected('imu') else 0,
                **self._reports.statistics()}

    # ---- work --------------------------------------------------------------------------------

    def _read_samples(self, now_ns: int) -> None:
        imu, detector, unpack = self.imu, self._detector, self._unpack
        while imu.take():
            if self._covariance[0] < 0.0:  # REP 145: no acceleration
                self._without_acceleration += 1
                continue
            stamp_ns = imu.stamp_ns
            if not self._silent:
                self._step_ns += 0.02 * (stamp_ns - detector.last_ns - self._step_ns)
            self._silent = False
            a, b, c, x, y, z = unpack(imu.buffer)
            event = detector.add(
                stamp_ns, x / STANDARD_GRAVITY_M_S2, y / STANDARD_GRAVITY_M_S2,
                z / STANDARD_GRAVITY_M_S2, math.degrees(math.sqrt(a * a + b * b + c * c)))
            if event is not None:
                self._report(event)
        self._time_ns = max(self._time_ns, detector.last_ns)
        silent_at_ns = detector.last_ns + self._silent_ns
        if self._silent or detector.last_ns < 0:
            return
        if now_ns < silent_at_ns:
            self._wake_up.no_later_than(silent_at_ns)
            return
        self._silent = True
        self._time_ns = max(self._time_ns, silent_at_ns)
        event = detector.finish()
        if event is not None:
            self._report(event._replace(stamp_ns=silent_at_ns))

    def _report(self, event: FallEvent) -> None:
        if event.kind is FallEventKind.RECOVERED:
            self._recoveries += 1
            self._reports.end(_KIND, self._person, event.stamp_ns,
                              f'{self._person} has got up and moves')
            return
        self._falls += 1
        evidence = event.evidence
        self._begin(Level.CRITICAL, _text(self._person, evidence), evidence.peak_g,
                    event.stamp_ns)

    def _read_peaks(self, now_ns: int) -> None:
        peaks, watch = self.peaks, self._watch
        while peaks.take():
            self._time_ns = max(self._time_ns, peaks.stamp_ns)
            self._advance_peaks(peaks.stamp_ns)
            peak_g = float(peaks.msg.data)
            if not math.isfinite(peak_g):
                continue
            # The sign shows only the direction along an axis.
            if watch.add(peaks.stamp_ns, abs(peak_g)) and (
                    self._detector.state is not DetectorState.FALLEN):
                self._recoveries += 1
                self._reports.end(_KIND, self._person, peaks.stamp_ns,
                                  f'{self._person} moves again')
        self._advance_peaks(now_ns)
        due_ns = watch.due_ns
        if due_ns is not None:
            self._wake_up.no_later_than(due_ns)

    def _advance_peaks(self, now_ns: int) -> None:
        watch = self._watch
        due_ns = watch.due_ns
        if due_ns is None or not watch.advance(now_ns):
            return
        self._time_ns = max(self._time_ns, due_ns)
        self._falls += 1
        self._begin(
            Level.URGENT, f'{self._person} was struck with {watch.blow_g:.1f} g and has not moved '
            f'for {self.settings["peak_quiet_s"]:.0f} s: perhaps a fall (confidence '
            f'{CONFIDENCE:.2f}, low: the node reports peaks only)', watch.blow_g, due_ns)

    def _begin(self, level: Level, text: str, value: float, stamp_ns: int) -> None:
        self._reports.report(Cause(
            _KIND, self._person, level, True, text, node=self.settings['node'],
            value=round(value, 2)), stamp_ns)

    # ---- state -------------------------------------------------------------------------------

    def _publish_state(self, stamp_ns: int) -> None:
        detector = self._detector
        told = (detector.state, detector.evidence, self._silent, self._watch.fallen)
        if told == self._published and stamp_ns - self._published_ns < _STATE_EVERY_NS:
            return
        self._published, self._published_ns = told, stamp_ns
        self.state.msg.data = json.dumps({'status': [self._status()]}, separators=(',', ':'))
        self.state.publish(stamp_ns)

    def _status(self) -> dict[str, Any]:
        detector = self._detector
        fallen = detector.state is DetectorState.FALLEN or self._watch.fallen
        blind = self._silent and self.connected('imu')
        off = detector.state is DetectorState.TAKEN_OFF
        values: dict[str, str] = {'state': 'fallen' if fallen else detector.state.value}
        evidence = detector.evidence
        if evidence is not None:
            values.update(
                peak_g=f'{evidence.peak_g:.2f}', least_g=f'{evidence.least_g:.2f}',
                stop_m_s=f'{evidence.stop_m_s:.2f}',
                descent_m_s=f'{evidence.descent_m_s:.2f}',
                turned_deg=f'{evidence.turned_deg:.0f}',
                **({} if math.isnan(evidence.tilt_deg) else {
                    'tilt_deg': f'{evidence.tilt_deg:.0f}'}),
                turn_deg_s=f'{evidence.turn_deg_s:.0f}', evidence=f'{evidence.score:.2f}',
                evidence_of_a_fall=f'{self._limits.evidence:g}',
                confidence=f'{evidence.confidence:.2f}')
        if detector.state is DetectorState.FALLEN:
            values['still_s'] = f'{(detector.last_ns - detector.moved_ns) / NS_PER_S:.0f}'
        if self._watch.blow_g:
            values['peak_alone_g'] = f'{self._watch.blow_g:.1f}'
        return {
            'level': _ERROR if fallen else _STALE if blind or off else _OK,
            'name': f'{self._person}: falls', 'hardware_id': self.settings['node'],
            'message': values['state'] + (', the sensor is silent' if blind else ''),
            'values': values}


def _text(person: str, evidence: Evidence) -> str:
    """Return the evidence as a sentence."""
    confidence = evidence.confidence
    word = 'high' if confidence >= 0.8 else 'medium' if confidence >= 0.65 else 'low'
    descent = (f' after a descent of {evidence.descent_m_s:.1f} m/s'
               if evidence.descent_m_s >= 0.5 else '')
    return (f'{person} has fallen: an impact of {evidence.peak_g:.1f} g{descent}, then turned by '
            f'{evidence.turned_deg:.0f} degrees and lying (confidence {confidence:.2f}, {word})')
