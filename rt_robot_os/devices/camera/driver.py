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
Cameras: V4L2, video files, folders of pictures, streams; Image, CompressedImage and CameraInfo.

The pictures are captured, converted and compressed in a separate process; here they are only
copied into their topics, in pieces. The stamp is the time at which the camera's Linux driver had
the picture, less ``latency_s``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
import os
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.camera.camera_info import load_calibration
from rt_robot_os.devices.camera.camera_info import uncalibrated
from rt_robot_os.devices.camera.requests import OBSERVATION_SETTINGS
from rt_robot_os.devices.camera.requests import ObservationRequests
from rt_robot_os.devices.camera.requests import OBSERVED_BYTES
from rt_robot_os.devices.camera.requests import PICTURE
from rt_robot_os.devices.capture.device import CaptureDevice
from rt_robot_os.devices.capture.packets import CapturedFrame
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.device import SamplePublisher
from rt_robot_os.devices.mounted import mounting_settings
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.mounting import mounting_of
from rt_robot_os.motion.mounting import OPTICAL
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_CHANNELS: Final = {'rgb8': 3, 'bgr8': 3, 'mono8': 1}
# PNG of noise is a little longer than its pixels.
_PACKED_EXTRA: Final = 8192
# Extra time without pictures, for a camera that changes its resolution for a still and back.
_STILL_S: Final = 8.0


class Camera(CaptureDevice):
    """A camera."""

    SOURCE = 'camera'
    SETTINGS = (
        Field('port', str, REQUIRED,
              'Device such as /dev/video0 (best one of /dev/v4l/by-id), video file, folder of '
              'pictures, or URL of a stream; sim: a moving pattern, or its view of the simulated '
              'world.'),
        Field('width', int, 640, 'Width of the pictures.', 'px', 32, 8192),
        Field('height', int, 480, 'Height of the pictures.', 'px', 16, 8192),
        Field('output_rate_hz', float, 30.0, 'Pictures per second.', 'Hz', 0.1, 1000.0),
        Field('encoding', str, 'rgb8', 'Encoding of the pixels.', choices=tuple(_CHANNELS)),
        Field('pixel_format', str, '',
              'Format that a V4L2 camera sends, such as MJPG or YUYV; empty: not changed.'),
        Field('topic', str, 'camera/image_raw', 'Topic of the pixels; empty for none.'),
        Field('compressed_topic', str, '', 'Topic of compressed pictures, such as '
              'camera/image_raw/compressed; empty for none.'),
        Field('info_topic', str, 'camera/camera_info', 'Topic of the calibration; empty: '
              'none.'),
        Field('compression', str, 'jpeg',
              'Quality of compressed pictures.', choices=('jpeg', 'png')),
        Field('quality', int, 80, 'Of JPEG.', minimum=1, maximum=95),
        Field('camera_info', str, '', 'Calibration of camera_calibration: path, file:// or '
              'package://; empty for an uncalibrated camera.', is_file=True),
        Field('frame_id', str, 'camera_optical_frame', 'Coordinate frame: z ahead, x to the '
              'right, y down.'),
        Field('body_frame_id', str, 'camera_link',
              'Frame of its housing: x ahead, y to the left, z up. It carries frame_id, rotated '
              'as in REP 103; empty: mounting_m and mounting_rad are those of frame_id itself.'),
        *mounting_settings(whose='body_frame_id', more='; 0, 0, 0 in mounting_rad looks ahead'),
        Field('depth', int, 4, 'Pictures that each topic keeps.', choices=(2, 4, 8, 16)),
        Field('loop', bool, True, 'Repeat a file or folder at its end.'),
        Field('latency_s', float, 0.0,
              'Time from exposure to arrival, subtracted from the stamp.', 's', 0.0, 1.0),
        *OBSERVATION_SETTINGS,
    )
    observe = Input('', wake=True, message='std_msgs/msg/String')
    observed = Output('', 'std_msgs/msg/String', tail=OBSERVED_BYTES, depth=8)
    description = 'camera (V4L2), video file, folder of pictures or stream'
    IF_SILENT = ('its process runs but captures no picture: check the cable, and the light if it '
                 'lowers its rate in the dark')

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings and read the calibration; nothing is opened.

        :raises ConfigError: nothing is published, or the calibration is unusable.
        """
        super().__init__(name, settings)
        s = settings
        if not (s['topic'] or s['compressed_topic']):
            raise ConfigError([f'{name}: topic and compressed_topic are both empty: name one'])
        if bool(s['observe_topic']) != bool(s['observed_topic']):
            raise ConfigError([f'{name}: observe_topic and observed_topic go together: name both, '
                               'or none'])
        self._requests = ObservationRequests(name, s)
        # Requested stills without an answer; and whether no picture has arrived since.
        self._stills, self._held_up = 0, False
        self._bytes_per_row = s['width'] * _CHANNELS[s['encoding']]
        self._raw_bytes = s['height'] * self._bytes_per_row if s['topic'] else 0
        self._packed_bytes = (s['height'] * self._bytes_per_row * 51 // 50 + _PACKED_EXTRA
                              if s['compressed_topic'] else 0)
        self._latency_ns = round(s['latency_s'] * NS_PER_S)
        self._info = (load_calibration(s['camera_info'], s['width'], s['height'])
                      if s['camera_info'] else uncalibrated(s['width'], s['height']))
        self._raw: SamplePublisher | None = None
        self._packed: SamplePublisher | None = None
        self._calibration: SamplePublisher | None = None

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications: Image, CompressedImage, CameraInfo, those with a topic."""
        s = self.settings
        head = {'header.frame_id': s['frame_id']}
        found = []
        if s['topic']:
            found.append(TopicSpec(
                s['topic'], 'sensor_msgs/msg/Image',
                {**head, 'encoding': s['encoding'], 'data': self._raw_bytes}, s['depth'],
                s['output_rate_hz']))
        if s['compressed_topic']:
            found.append(TopicSpec(
                s['compressed_topic'], 'sensor_msgs/msg/CompressedImage',
                {**head, 'format': s['compression']}, s['depth'], s['output_rate_hz'],
                self._packed_bytes))
        if s['info_topic']:
            found.append(TopicSpec(
                s['info_topic'], 'sensor_msgs/msg/CameraInfo', {**head, **self._info.fixed},
                s['depth'], s['output_rate_hz']))
        if self.connected('observed'):
            found.append(TopicSpec(s['observed_topic'], self.ports()['observed'].message, {}, 8,
                                   0.0, OBSERVED_BYTES))
        return tuple(found)

    def connected(self, attribute: str) -> bool:
        """Return whether a topic is used: one with an empty name is not."""
        return bool(self.topic_of(attribute))

    @classmethod
    def mountings(cls, settings: Mapping[str, Any]) -> Mapping[str, Mounting]:
        """Return the mounting of its housing, and of the frame of its pictures on that."""
        body = settings.get('body_frame_id', '')
        if not body or body == settings['frame_id']:
            return super().mountings(settings)
        return {body: mounting_of(settings),
                settings['frame_id']: replace(OPTICAL, parent=body)}

    def bind(self, publishers: Any) -> None:
        """Bind the publishers and write the constant fields."""
        super().bind(publishers)
        s, rest = self.settings, list(self._publishers)
        if s['topic']:
            self._raw = rest.pop(0)
            message = self._raw.msg
            message.height, message.width, message.step = (
                s['height'], s['width'], self._bytes_per_row)
        if s['compressed_topic']:
            self._packed = rest.pop(0)
        if s['info_topic']:
            self._calibration = rest.pop(0)
            self._info.fill(self._calibration.msg)

    def slot_bytes(self) -> int:
        """Return the largest size of a picture in bytes, raw and compressed together."""
        return self._raw_bytes + self._packed_bytes

    def check(self) -> None:
        """
        Check the path, so that the error message is specific.

        :raises DeviceError: it does not exist, or may not be opened.
        """
        port = self.settings['port']
        if '://' in port:
            return
        if not os.path.exists(port):
            raise DeviceError(f'{port} does not exist: check the cable and the path '
                              '(ls -l /dev/v4l/by-id)')
        if not os.access(port, os.R_OK):
            raise DeviceError(f'{port} may not be opened by this user: sudo usermod -aG video '
                              '$USER, then log in again; of a file, check its permissions')

    def read(self, now_ns: int) -> int:
        """
        Forward requests, and publish the available pictures; does not block.

        :raises DeviceError: the process has ended, or reports a problem.
        """
        if self._requests.enabled:
            while self.observe.take():
                told = self._requests.handle(str(self.observe.msg.data), self.observe.stamp_ns,
                                             now_ns, self.request)
                if told is not None:
                    self.observe_ended(told, now_ns)
        return super().read(now_ns)

    def open(self) -> None:  # noqa: A003
        """
        Start the capture process; its problems are reported later, by :meth:`read`.

        :raises DeviceError: the process cannot be started.
        """
        self._stills, self._held_up = 0, False
        super().open()

    def quiet_s(self) -> float:
        """Return how long pictures may be missing: a still delays them."""
        return _STILL_S if self._held_up else 0.0

    def request(self, request: dict[str, Any]) -> str:
        """
        Send a request to the process; safe in the loop.

        :return: why it cannot be sent; empty if it was.
        """
        problem = super().request(request)
        if not problem and request['order'] == PICTURE:
            self._stills += 1
            self._held_up = True
        return problem

    def observe_ended(self, told: dict[str, Any], now_ns: int) -> None:
        """Publish the result of a request."""
        if told.get('kind') == PICTURE:
            self._stills = max(0, self._stills - 1)
        if self._requests.enabled:
            self.observed.msg.data = self._requests.answer(told)
            self.observed.publish(now_ns)

    def statistics(self) -> DeviceStatistics:
        """Return the current counters, including those of requests."""
        found = super().statistics()
        return replace(found, more={**found.more, **self._requests.statistics()})

    def handle(self, frame: CapturedFrame, data: memoryview) -> int:
        """Publish a picture; in the loop, preempted after each 64 KiB."""
        if not self._stills:
            self._held_up = False
        stamp_ns = frame.stamp_ns - self._latency_ns
        samples = 0
        if self._raw is not None and frame.first == self._raw_bytes:
            self._raw.fill(data[:frame.first])
            self._raw.publish(stamp_ns)
            samples += 1
        if self._packed is not None and 0 < frame.second <= self._packed_bytes:
            self._packed.fill(data[frame.first:frame.first + frame.second])
            self._packed.publish(stamp_ns)
            samples += 1
        if self._calibration is not None and samples:
            self._calibration.publish(stamp_ns)
            samples += 1
        return samples
