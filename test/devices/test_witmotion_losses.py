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

"""Is every lost sample of a WitMotion unit counted, and none made of two instants."""

from __future__ import annotations

import random
from typing import Any

from driver_fakes import read_all
from driver_fakes import scripted
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from imu_streams import ACC
from imu_streams import ACC_HALF
from imu_streams import ANGLE
from imu_streams import GYRO
from imu_streams import GYRO_HALF
from imu_streams import instant
from imu_streams import MAG
from imu_streams import MAG_SCALE_T
from imu_streams import numbers
from imu_streams import QUAT
from imu_streams import recorded_motion
from imu_streams import row_frames
from imu_streams import vectors
import numpy as np
from rt_robot_os.devices.witmotion.driver import WitMotion


def test_the_recorded_motion_survives_encoding_and_decoding() -> None:
    rows = recorded_motion()
    chunk = 997
    stream = b''.join(b''.join(row_frames(row)) for row in rows)
    chunks = [stream[i:i + chunk] for i in range(0, len(stream), chunk)]
    with scripted(WitMotion, chunks) as (device, (imu, mag)):
        read_all(device, len(chunks), step_ns=1_000_000)
        assert len(imu.samples) == len(mag.samples) == len(rows) == 13514
        assert device.statistics().lost_samples == 0
        gyro, acceleration, magnetic = (np.array(column) for column in zip(*rows))
        assert np.abs(vectors(imu, 'angular_velocity') - gyro).max() <= GYRO_HALF * 1.0001
        assert np.abs(vectors(imu, 'linear_acceleration') - acceleration).max() <= (
            ACC_HALF * 1.0001)
        assert np.abs(vectors(mag, 'magnetic_field') - magnetic).max() <= MAG_SCALE_T / 2 * 1.0001


def test_frames_missing_from_the_recorded_motion_are_counted_exactly() -> None:
    # One read every 5 ms, one instant every 100 ms: what arrives tells instants apart.
    chance = random.Random(3)
    rows = recorded_motion()[:3000]
    chunks: list[bytes] = []
    expected, lost, fields = [], 0, 0
    for index, row in enumerate(rows):
        frames = row_frames(row)
        kept = [f for f in frames if index == 0 or chance.random() > 0.1]
        chunks += [b''.join(kept)] + [b''] * 19
        fields += frames[2] in kept
        if frames[0] in kept and frames[1] in kept:
            expected.append(row[1])
        elif kept:
            lost += 1
    assert lost > 400
    with scripted(WitMotion, chunks) as (device, (imu, mag)):
        read_all(device, len(chunks), step_ns=5_000_000)
        assert device.statistics().lost_samples == lost
        assert len(mag.samples) == fields
        assert len(imu.samples) == len(expected)
        assert np.abs(vectors(imu, 'linear_acceleration') - expected).max() <= ACC_HALF * 1.0001


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_damaged_frames_lose_their_own_sample_only(data: Any) -> None:
    # Contiguous bytes, no help from time: a flipped bit in one frame of an instant.
    kinds = data.draw(st.sampled_from([(ACC, GYRO, ANGLE, MAG, QUAT), (ACC, GYRO, ANGLE)]))
    count = 30
    damaged = data.draw(st.dictionaries(
        st.integers(1, count - 2), st.integers(0, len(kinds) - 1), max_size=10))
    # Relearning needs eight equal instants in a row, and gaps must not meet.
    damaged = {n: k for n, k in damaged.items() if n - 1 not in damaged and n + 1 not in damaged}
    stream = []
    for number in range(count):
        frames = instant(number + 1, kinds)
        if number in damaged:
            bad = bytearray(frames[damaged[number]])
            bad[data.draw(st.integers(2, 9))] ^= 1 << data.draw(st.integers(0, 7))
            frames[damaged[number]] = bytes(bad)
        stream.append(b''.join(frames))
    with scripted(WitMotion, [b''.join(stream)]) as (device, (imu, _)):
        device.read(1)
        expected = [n + 1 for n in range(count) if n not in damaged]
        # 0x54 lies between frames of one sample: the gap where it was may hide a whole instant.
        assert numbers(imu) == expected
        statistics = device.statistics()
        assert statistics.lost_samples == len(damaged)
        assert statistics.rejected_frames >= len(damaged)
        assert statistics.rejected_bytes == 11 * len(damaged)


def test_two_instants_are_never_mixed_when_a_gap_joins_them() -> None:
    one, two = instant(1), instant(2)
    stream = b''.join(instant(9)) * 3
    # ACC and GYRO of one instant, then 33 damaged bytes, then the rest of another.
    broken = b''.join(one[:2]) + bytes(33) + b''.join(two[2:])
    with scripted(WitMotion, [stream + broken + b''.join(instant(3))]) as (device, (imu, _)):
        device.read(1)
        assert numbers(imu) == [9, 9, 9, 3]
        assert device.statistics().lost_samples == 1


def test_without_an_angle_frame_there_is_still_the_quaternion() -> None:
    rest = instant(3)
    del rest[2]
    stream = b''.join(instant(1) + instant(2) + rest + instant(4))
    with scripted(WitMotion, [stream]) as (device, (imu, _)):
        device.read(1)
        assert numbers(imu) == [1, 2, 3, 4]
        assert device.statistics().lost_samples == 0


def test_a_pause_ends_an_instant() -> None:
    one, two = instant(1), instant(2)
    chunks = [b''.join(instant(9) * 3), b''.join(one[:2]), b'', b'', b''.join(two[2:]),
              b''.join(instant(3))]
    with scripted(WitMotion, chunks) as (device, (imu, _)):
        read_all(device, len(chunks), step_ns=60_000_000)
        assert numbers(imu) == [9, 9, 9, 3]
        assert device.statistics().lost_samples == 2


def test_the_rest_of_an_instant_after_opening_is_not_a_loss() -> None:
    stream = b''.join(instant(1)[3:] + instant(2) + instant(3))
    with scripted(WitMotion, [stream]) as (device, (imu, _)):
        device.read(1)
        assert numbers(imu) == [2, 3]
        assert device.statistics().lost_samples == 0


def test_a_changed_output_mask_is_learned_while_running() -> None:
    before, after = (ACC, GYRO, ANGLE, QUAT), (ACC, GYRO, ANGLE)
    stream = [b''.join(instant(n, before if n < 10 else after)) for n in range(1, 41)]
    with scripted(WitMotion, stream) as (device, (imu, _)):
        read_all(device, len(stream))
        got = numbers(imu)
        lost = device.statistics().lost_samples
        assert got == [*range(1, 10), *range(10 + lost, 41)]
        assert 0 < lost <= 10
