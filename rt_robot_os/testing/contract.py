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
The contract of every serial driver; a driver's test inherits it.

    class TestMyDriver(DriverContract):
        driver = MyDriver
        stream = b'what the device sends'
        samples = 3
        tokens = (b'pieces', b'of it')

        def decoder(self):
            return MyDecoder()

        def frame_size(self, frame):
            return frame.size
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
import errno
import os
from pathlib import Path
import random
from typing import Any
from typing import ClassVar

import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.errors import TopicError
from rt_robot_os.devices.device import Device
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.testing.examples import check_with_examples
from rt_robot_os.testing.examples import strategies
from rt_robot_os.testing.fakes import bind
from rt_robot_os.testing.fakes import opened
from rt_robot_os.testing.fakes import read_all
from rt_robot_os.testing.fakes import read_until
from rt_robot_os.testing.fakes import scripted_settings
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.fakes import wait_for_device_error
from rt_robot_os.testing.sample_contract import SampleContract


class DriverContract(SampleContract):
    """
    The contract; those of the decoder and of the samples are part of it.

    :cvar samples: number of samples of the stream, on all topics.
    """

    samples: ClassVar[int]

    def publishers(self, device: Device) -> list[Any]:
        """Bind a device to publishers that have ``stamps`` and comparable ``values``."""
        return list(bind(device))

    # --- bytes ---------------------------------------------------------------------------------

    @contextmanager
    def scripted(self, chunks: list[bytes], **changes: Any) -> Iterator[tuple[Any, list[Any]]]:
        """Open the device on a port that returns these chunks, one per read."""
        device = self.driver('dut', settings_of(
            self.driver, **scripted_settings({**self.changes, **changes})))
        publishers = self.publishers(device)
        with opened(device, chunks):
            yield device, publishers

    def run(self, chunks: list[bytes]) -> tuple[list[Any], list[Any], Any]:
        """Return the values, the stamps and the counters for the bytes."""
        with self.scripted(chunks) as (device, publishers):
            read_all(device, len(chunks))
            # How many bytes waited for a later job depends on the splits.
            return ([p.values for p in publishers], [p.stamps for p in publishers],
                    replace(device.statistics(), deferred_bytes=0))

    def test_the_stream_gives_all_its_samples(self) -> None:
        values, _, statistics = self.run([self.stream])
        assert sum(len(v) for v in values) == self.samples == statistics.samples
        assert statistics.rejected_bytes == 0
        assert statistics.rejected_frames == 0
        assert statistics.lost_samples == 0

    def test_every_split_point_gives_equal_results(self) -> None:
        whole = self.run([self.stream])
        for at in range(len(self.stream) + 1):
            assert self.run([self.stream[:at], self.stream[at:]]) == whole, at
        assert self.run([bytes((b,)) for b in self.stream]) == whole

    def test_every_split_of_a_damaged_stream_gives_equal_results(self) -> None:
        noise = random.Random(2)
        stream = bytearray(self.stream)
        for _ in range(6):
            stream[noise.randrange(len(stream))] ^= 1 << noise.randrange(8)
        damaged = bytes(stream)
        whole = self.run([damaged])
        for at in range(len(damaged) + 1):
            assert self.run([damaged[:at], damaged[at:]]) == whole, at

    def test_it_finds_its_way_out_of_garbage(self) -> None:
        garbage = random.Random(1).randbytes(500)
        values, _, statistics = self.run([garbage + self.stream + garbage + self.stream])
        assert sum(len(v) for v in values) >= 2 * self.samples - 4
        assert statistics.rejected_bytes > 900

    def test_any_bytes_raise_nothing_and_every_byte_is_accounted_for(self) -> None:
        st = strategies()
        piece = st.binary(max_size=30) | st.sampled_from((*self.tokens, self.stream))
        check_with_examples(st.lists(piece, max_size=20), self.check_any_bytes, 60)

    def check_any_bytes(self, chunks: list[bytes]) -> None:
        """Feed chunks, and check that every byte is in a frame, rejected or pending."""
        decoder = self.decoder()
        framed = 0
        for chunk in chunks:
            for frame in decoder.feed(chunk):
                assert -self.pending_limit < frame.end <= len(chunk)
                framed += self.frame_size(frame)
        fed = sum(map(len, chunks))
        assert fed == framed + decoder.rejected_bytes + decoder.pending_bytes
        assert decoder.pending_bytes < self.pending_limit
        values, stamps, statistics = self.run(chunks)
        assert statistics.bytes_read == fed
        assert statistics.frames == decoder.frames
        assert statistics.ignored_frames <= statistics.frames
        assert all(s == sorted(s) for s in stamps)
        assert sum(len(v) for v in values) == statistics.samples
        joined = self.run([b''.join(chunks)])
        assert (values, statistics.rejected_bytes) == (joined[0], joined[2].rejected_bytes)

    def test_frames_are_dated_back_by_the_bytes_behind_them(self) -> None:
        # 10 bits per byte at 100 kbaud are 100 us.
        with self.scripted([self.stream], baud=100_000) as (device, publishers):
            device.read(10**12)
            stamps = sorted(s for p in publishers for s in p.stamps)
        earliest = 10**12 - len(self.stream) * 100_000
        assert earliest < stamps[0] < stamps[-1] <= 10**12
        assert all((s - earliest) % 100_000 == 0 for s in stamps)

    def test_stamps_never_go_back(self) -> None:
        # Read faster than the declared line: each chunk would be back-dated before the last.
        with self.scripted([self.stream] * 3, baud=9600) as (device, publishers):
            read_all(device, 3, now_ns=10**12, step_ns=1000)
            for publisher in publishers:
                assert len(publisher.stamps) >= 3
                assert publisher.stamps == sorted(publisher.stamps)

    def test_half_a_frame_is_not_completed_by_what_comes_after_opening_again(self) -> None:
        half = len(self.stream) // 2 + 3
        with self.scripted([self.stream[:half]]) as (device, _):
            device.read(1)
            pending = device.pending_bytes
            rejected = device.statistics().rejected_bytes
            device.open()
            assert device.pending_bytes == 0
            assert device.statistics().rejected_bytes == rejected + pending

    # --- the contract with the SensorManager ----------------------------------------------------

    def make(self, port: str | os.PathLike[str]) -> tuple[Device, list[Any]]:
        """Make the driver on a port, and its publishers."""
        device = self.driver('dut', settings_of(
            self.driver, **{**self.changes, 'port': str(port), 'baud': 0}))
        return device, self.publishers(device)

    def test_publications_name_topic_type_and_what_is_fixed(self) -> None:
        device, _ = self.make('nowhere')
        assert device.publications() == device.publications()
        for publication in device.publications():
            assert publication.topic
            assert publication.message.split('/')[1] == 'msg'
            assert publication.fixed['header.frame_id'] == device.settings['frame_id']
            assert publication.depth & (publication.depth - 1) == 0
            assert publication.rate_hz > 0
        assert self.driver.description

    def test_a_wrong_number_of_publishers_is_refused(self) -> None:
        device, publishers = self.make('nowhere')
        with pytest.raises(TopicError, match='dut: .* bind one for each'):
            device.bind(publishers[1:])

    def test_settings_have_names_descriptions_and_valid_defaults(self) -> None:
        names = [f.name for f in self.driver.fields()]
        assert len(names) == len(set(names))
        assert all(f.description for f in self.driver.fields())
        settings_of(self.driver, port='x')

    # --- real ptys -----------------------------------------------------------------------------

    def test_it_reads_from_a_real_pty(self, tmp_path: Path) -> None:
        port = PtyPort(tmp_path / 'dut')
        port.plug()
        device, publishers = self.make(port.link)
        device.open()
        assert device.read(1) == 0
        port.write(self.stream)
        assert read_until(device, len(self.stream)) == self.samples
        assert device.statistics().last_frame_ns == 1_000_000_000
        device.close()
        port.unplug()

    def test_open_and_close_may_be_repeated(self, tmp_path: Path) -> None:
        port = PtyPort(tmp_path / 'dut')
        port.plug()
        device, _ = self.make(port.link)
        device.close()
        device.open()
        device.open()
        port.write(self.stream)
        read_until(device, len(self.stream))
        device.close()
        device.close()
        assert device.fileno() is None
        assert device.statistics().bytes_read == len(self.stream)
        device.open()
        port.write(self.stream)
        read_until(device, 2 * len(self.stream))
        device.close()
        port.unplug()

    def test_what_came_before_opening_is_discarded(self, tmp_path: Path) -> None:
        port = PtyPort(tmp_path / 'dut')
        port.plug()
        other = os.open(port.link, os.O_RDWR | os.O_NOCTTY)
        port.write(self.stream)
        device, _ = self.make(port.link)
        device.open()
        os.close(other)
        assert device.read(1) == 0
        port.write(self.stream[:5])
        read_until(device, 5)
        assert device.statistics().bytes_read == 5
        device.close()
        port.unplug()

    def test_a_missing_port_is_an_error_with_a_remedy(self) -> None:
        device, _ = self.make('/dev/there-is-no-such-port')
        with pytest.raises(DeviceError, match='dut: port /dev/there.*check the cable'):
            device.open()
        device.close()

    def test_reading_before_opening_is_an_error(self) -> None:
        device, _ = self.make('nowhere')
        with pytest.raises(DeviceError, match='dut: .*call open'):
            device.read(1)

    def test_unplugging_is_an_error_and_it_can_be_opened_again(self, tmp_path: Path) -> None:
        port = PtyPort(tmp_path / 'dut')
        port.plug()
        device, _ = self.make(port.link)
        device.open()
        port.unplug()
        error = wait_for_device_error(device)
        assert 'dut: port' in str(error)
        assert 'check the cable' in str(error)
        assert error.errno in (None, errno.EIO)
        with pytest.raises(DeviceError):
            device.read(1)
        device.close()
        with pytest.raises(DeviceError, match='does not exist'):
            device.open()
        port.plug()
        device.open()
        port.write(self.stream)
        assert read_until(device, len(self.stream)) == self.samples
        device.close()
        port.unplug()
