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
Microphones and WAV files: level, peak, and the samples themselves.

Sound is captured in a separate process, which also computes the levels. The driver copies each
block into its topic. The stamp of all topics is that of the first sample of the block.
"""

from __future__ import annotations

from collections.abc import Mapping
import os
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.capture.device import CaptureDevice
from rt_robot_os.devices.capture.packets import CapturedFrame
from rt_robot_os.devices.device import SamplePublisher

_SAMPLE_BYTES: Final = 2
_TOPICS: Final = ('topic', 'level_topic', 'peak_topic', 'time_topic')


class Microphone(CaptureDevice):
    """A microphone, or a recording."""

    SOURCE = 'sound'
    SETTINGS = (
        Field('port', str, REQUIRED, 'Sound input: default, its number, or a part of its name '
              '(python3 -m sounddevice lists them), or a file that ends with .wav; sim: a tone.'),
        Field('sample_rate_hz', int, 48000, 'Samples per second of each channel.', 'Hz', 8000,
              192000),
        Field('channels', int, 1, 'Channels, interleaved in each block.', minimum=1, maximum=16),
        Field('block', int, 960, 'Samples of each channel in a block; 960 are 20 ms at 48 kHz.',
              minimum=16, maximum=48000),
        Field('topic', str, 'sound/samples', 'Topic of the samples; empty for none.'),
        Field('level_topic', str, 'sound/level', 'Topic of the level (root mean square); empty '
              'for none.'),
        Field('peak_topic', str, 'sound/peak', 'Topic of the highest peak; empty for none.'),
        Field('time_topic', str, 'sound/time',
              'Topic of the time of the first sample of each block; empty for none.'),
        Field('frame_id', str, 'microphone_link',
              'Coordinate frame, published as the source of the time.'),
        Field('depth', int, 16, 'Blocks that each topic keeps.', choices=(2, 4, 8, 16, 32, 64)),
        Field('loop', bool, True, 'Repeat a file at its end.'),
        Field('latency_s', float, 0.0,
              'Time from the air to the sound card, subtracted from the stamp.',
              's', 0.0, 1.0),
    )
    description = 'microphone (PortAudio) or WAV file'
    IF_SILENT = 'its process runs but records nothing: check that the input is plugged in'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: nothing is published.
        """
        super().__init__(name, settings)
        self._wanted = [key for key in _TOPICS if settings[key]]
        if not self._wanted:
            raise ConfigError([f'{name}: {", ".join(_TOPICS)} are all empty: name one'])
        self._size: int = settings['block'] * settings['channels'] * _SAMPLE_BYTES
        self._latency_ns = round(settings['latency_s'] * NS_PER_S)
        self._rate_hz = settings['sample_rate_hz']
        self._by_key: dict[str, SamplePublisher] = {}

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications: Int16MultiArray, Float32 twice, TimeReference."""
        s = self.settings
        block, channels = s['block'], s['channels']
        kinds: dict[str, tuple[str, dict[str, object]]] = {
            'topic': ('std_msgs/msg/Int16MultiArray', {
                'layout.dim': [
                    {'label': 'frames', 'size': block, 'stride': block * channels},
                    {'label': 'channels', 'size': channels, 'stride': channels}],
                'data': block * channels}),
            'level_topic': ('std_msgs/msg/Float32', {}),
            'peak_topic': ('std_msgs/msg/Float32', {}),
            'time_topic': ('sensor_msgs/msg/TimeReference', {'source': s['frame_id']}),
        }
        return tuple(TopicSpec(s[key], *kinds[key], s['depth'], self._rate_hz / block)
                     for key in self._wanted)

    def bind(self, publishers: Any) -> None:
        """Take the publishers."""
        super().bind(publishers)
        self._by_key = dict(zip(self._wanted, self._publishers, strict=True))

    def slot_bytes(self) -> int:
        """Return the bytes of a block."""
        return self._size

    def check(self) -> None:
        """
        Check the path, if the port is a file.

        :raises DeviceError: it does not exist.
        """
        port = self.settings['port']
        if ('/' in port or port.lower().endswith(('.wav', '.wave'))) and not os.path.exists(port):
            raise DeviceError(f'{port} does not exist: check the path')

    def handle(self, frame: CapturedFrame, data: memoryview) -> int:
        """Publish a block and its levels; in the loop."""
        if frame.first != self._size:
            self._rejected += 1
            return 0
        stamp_ns = frame.stamp_ns - self._latency_ns
        for key, publisher in self._by_key.items():
            if key == 'topic':
                publisher.fill(data)
            elif key == 'time_topic':
                # The position of the block in the stream, as counted by the sound card.
                second, rest = divmod(frame.seq * self.settings['block'], self._rate_hz)
                publisher.msg.time_ref.sec = second & 0x7FFFFFFF
                publisher.msg.time_ref.nanosec = rest * NS_PER_S // self._rate_hz
            else:
                publisher.msg.data = frame.rms_db if key == 'level_topic' else frame.peak_db
            publisher.publish(stamp_ns)
        return len(self._by_key)
