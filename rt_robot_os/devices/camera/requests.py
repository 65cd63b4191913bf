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
Requests to a camera: a picture at full resolution, a clip of the seconds before and after.

They arrive as JSON and are forwarded to the capture process; its answers are published as JSON. A
request that is invalid or late, or cannot be forwarded, is answered immediately.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import json
import math
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.device import Value

#: The longest answer, in bytes.
OBSERVED_BYTES: Final = 2000
#: The kinds of requests.
PICTURE: Final = 'picture'
REQUEST_KINDS: Final = (PICTURE, 'clip')

_AFTER_MOST_S: Final = 60.0
# The sender waits no longer: the robot may have left.
_LATE_NS: Final = 10 * NS_PER_S
_LONGEST_TEXT: Final = 64
_LONGEST_PROBLEM: Final = 300

OBSERVATION_SETTINGS: Final = (
    Field('observe_topic', str, '',
          'Topic of requests for pictures and clips in files, such as camera/observe of the '
          'module observer; empty: none. It needs Pillow.'),
    Field('observed_topic', str, '', 'Topic of the answers, such as camera/observed.'),
    Field('still_width', int, 0,
          'Width of a requested picture, such as the largest of the camera; 0: as width.',
          'px', 0, 8192),
    Field('still_height', int, 0, 'Height of a requested picture; 0: as height.', 'px', 0, 8192),
    Field('clip_s', float, 10.0,
          'Duration of the past that is kept in memory for clips; 0: nothing.',
          's', 0.0, 120.0),
    Field('clip_rate_hz', float, 5.0, 'Pictures per second in memory, and in clips.', 'Hz', 0.1,
          60.0),
    Field('clip_mb', float, 32.0, 'Limit of that memory.', 'MB', 0.1, 512.0),
    Field('observations_folder', str, '', 'Folder of the files; empty: observations in $ROS_HOME '
          'or ~/.ros.'),
    Field('observations_files', int, 200,
          'Limit of the files there; the oldest are deleted.', '', 2, 100_000),
    Field('observations_mb', float, 500.0, 'Limit of their total size.', 'MB', 1.0, 1e6),
)


def parse_request(text: str, before_most_s: float) -> dict[str, Any]:
    """
    Parse a request.

    :param before_most_s: how much of the past a camera keeps.
    :raises ValueError: it is invalid; the text contains the reason.
    """
    try:
        found = json.loads(text)
    except RecursionError:
        raise ValueError('the request is nested too deeply') from None
    if not isinstance(found, dict) or found.get('order') not in REQUEST_KINDS:
        raise ValueError(f'{text[:60]!r} is not a request: write '
                         f'{{"order": "picture", "alarm": "a1"}}')
    request: dict[str, Any] = {'order': found['order']}
    for key in ('alarm', 'subject'):
        request[key] = str(found.get(key, ''))[:_LONGEST_TEXT]
    number = found.get('id', 0)
    request['id'] = number if isinstance(number, int) and 0 <= number < 1 << 53 else 0
    for key, most in (('before_s', before_most_s), ('after_s', _AFTER_MOST_S)):
        value = found.get(key, 0.0)
        if isinstance(value, bool) or not isinstance(value, int | float) or not (
                math.isfinite(value)):
            raise ValueError(f'{key} {str(value)[:20]!r}: must be a finite number of seconds')
        request[key] = min(max(0.0, float(value)), most)
    return request


class ObservationRequests:
    """
    The requests to one camera, and their answers; safe in the real-time loop.

    :param name: of the camera.
    :param settings: its settings.
    :ivar enabled: the camera accepts requests.
    """

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        self.enabled = bool(settings['observe_topic'])
        self._name = name
        self._clip_s: float = settings['clip_s']
        self._requests = self._refused = self._late = self._kept = self._problems = 0
        self._deleted = 0
        self._problem = ''

    def handle(self, text: str, stamp_ns: int, now_ns: int,
               forward: Callable[[dict[str, Any]], str]) -> dict[str, Any] | None:
        """
        Forward a request.

        :param forward: sends it; returns why it cannot.
        :return: the answer, if it is known already.
        """
        self._requests += 1
        try:
            request = parse_request(text, self._clip_s)
        except ValueError as error:
            self._refused += 1
            return {'id': 0, 'alarm': '', 'kind': '', 'problem': str(error)[:_LONGEST_PROBLEM]}
        if now_ns - stamp_ns > _LATE_NS:
            self._late += 1
            problem = 'the camera was not available at the time of the request'
        else:
            problem = forward({**request, 't_ns': stamp_ns})
        if not problem:
            return None
        return {'id': request['id'], 'alarm': request['alarm'], 'subject': request['subject'],
                'kind': request['order'], 'problem': problem}

    def answer(self, told: Mapping[str, Any]) -> str:
        """Count an answer, and encode it."""
        found = {key: value for key, value in told.items() if key != 'version'}
        self._problem = str(found.get('problem', ''))[:_LONGEST_PROBLEM]
        self._problems += bool(self._problem)
        self._kept += not self._problem
        self._deleted += int(found.get('deleted', 0))
        found['camera'] = self._name
        text = json.dumps(found, ensure_ascii=True, separators=(',', ':'))
        if len(text) > OBSERVED_BYTES:
            text = json.dumps({'id': found.get('id', 0), 'alarm': str(found.get('alarm', '')),
                               'kind': str(found.get('kind', '')), 'camera': self._name,
                               'problem': 'the answer is too long: choose a shorter '
                               'observations_folder'}, separators=(',', ':'))
        return text

    def statistics(self) -> dict[str, Value]:
        """Return counters, and the last problem; nothing for a camera without requests."""
        if not self.enabled:
            return {}
        return {'orders': self._requests, 'orders_refused': self._refused,
                'orders_late': self._late, 'observations': self._kept,
                'observation_problems': self._problems, 'observations_deleted': self._deleted,
                'warning': f'no picture could be stored: {self._problem}' if self._problem else ''}
