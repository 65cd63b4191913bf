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

"""Does the StarGazer driver publish where base_link is, and set the device up as it wants it."""

from __future__ import annotations

import math
from pathlib import Path
import random
from typing import Any

from driver_contract import DriverContract
from driver_fakes import scripted
from driver_fakes import settings_of
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.stargazer import wire
from rt_robot_os.devices.stargazer.driver import StarGazer
from rt_robot_os.devices.stargazer.wire import CeilingMark
from rt_robot_os.devices.stargazer.wire import StarGazerDecoder
from rt_robot_os.motion.angles import yaw_of

MS = 1_000_000
ROOM = ['24706: 0, 0, 0', '24594: -1.5, 0, 0', '48: 1.0, 2.0, 1.5707963267948966']


def seen(number: int = 24706, angle_deg: float = 0.0, x_cm: float = 0.0, y_cm: float = 0.0,
         z_cm: float = 220.0) -> CeilingMark:
    return CeilingMark(number, angle_deg, x_cm, y_cm, z_cm)


class TestStarGazer(DriverContract):
    driver = StarGazer
    changes = {'landmarks': ROOM}
    stream = (b'~*DeadZone`' + wire.multi([seen(x_cm=10.0)])
              + wire.multi([seen(x_cm=10.0, y_cm=-3.0), seen(24594, 1.0, 161.0, -2.0)])
              + wire.single(seen(48, -20.0, 3.0)) + wire.old(seen(48, -20.0, 3.0)))
    samples = 4
    tokens = (b'~', b'`', b'~^', b'~^1', b'~^I', b'|', wire.multi([seen(99)]), b'~!CalcStop`',
              wire.multi([seen(), seen(24594, 170.0)]), b'~^I+0.00|+5.00|+5.00|48`',
              wire.single(seen(), 'F'), b'~*DeadZone`')
    vectors = ((wire.multi([seen(24706, 0.0, 100.0, -50.0)]),
                {'pose.pose.position.x': 1.0, 'pose.pose.position.y': -0.5}),
               # Clockwise: a quarter to the left is -90 degrees.
               (wire.multi([seen(24706, -90.0)]),
                {'pose.pose.orientation.z': math.sqrt(0.5),
                 'pose.pose.orientation.w': math.sqrt(0.5)}))

    def decoder(self) -> Any:
        return StarGazerDecoder()

    def frame_size(self, frame: Any) -> int:
        return int(frame.size)

    def covered(self, frame: bytes) -> tuple[int, ...]:
        return ()  # it has no checksum

    def test_publications_name_topic_type_and_what_is_fixed(self) -> None:
        # The pose is that of the robot in the map, not one in the frame of the sensor.
        device, _ = self.make('nowhere')
        publication, = device.publications()
        assert publication.fixed['header.frame_id'] == 'map'
        assert publication.topic == 'stargazer/pose'
        assert (publication.depth, publication.rate_hz) == (16, 20.0)


def poses(*sentences: bytes, step_ms: int = 50, **changes: Any) -> list[Any]:
    """Return x, y and heading, and the message, of each sample."""
    with scripted(StarGazer, sentences, **{'landmarks': ROOM, **changes}) as (device, (out,)):
        for number in range(len(sentences)):
            device.read(1_000 * MS + number * step_ms * MS)
        return [(s.pose.pose.position.x, s.pose.pose.position.y,
                 yaw_of(0.0, 0.0, s.pose.pose.orientation.z, s.pose.pose.orientation.w), s)
                for s in out.samples]


def pose(*sentences: bytes, **changes: Any) -> tuple[float, float, float]:
    x, y, heading, _ = poses(*sentences, **changes)[-1]
    return x, y, heading


def test_the_frame_of_the_mark_is_brought_into_the_map() -> None:
    # Mark 48 is turned by 90 degrees: its x is the map's y.
    assert pose(wire.multi([seen(48, -20.0, 30.0, 10.0)])) == pytest.approx(
        (0.9, 2.3, math.radians(110.0)))


def test_sign_and_offset_of_the_angle() -> None:
    data = wire.multi([seen(angle_deg=30.0)])
    assert pose(data)[2] == pytest.approx(math.radians(-30))
    assert pose(data, angle_sign=1)[2] == pytest.approx(math.radians(30))
    assert pose(data, angle_sign=1, angle_offset_rad=math.pi)[2] == pytest.approx(
        math.radians(-150))


def test_the_mounting_is_taken_off() -> None:
    # The sensor sits 20 cm ahead of the axle and 5 cm to the left, turned to the left by 90
    # degrees; the robot looks along y.
    data = wire.multi([seen(24706, -180.0, -5.0, 20.0)])
    with scripted(StarGazer, [data], landmarks=ROOM, mounting_m=[0.2, 0.05, 1.0],
                  mounting_rad=[0.0, 0.0, math.pi / 2]) as (device, (out,)):
        device.read(1)
        found = out.samples[0].pose.pose
    assert (found.position.x, found.position.y, found.position.z) == pytest.approx((0, 0, 0))
    assert yaw_of(0, 0, found.orientation.z, found.orientation.w) == pytest.approx(math.pi / 2)


def test_several_marks_are_averaged_on_the_circle() -> None:
    # 179 and -179 degrees are 180, not 0.
    x, y, heading = pose(wire.multi([
        seen(24706, 179.0, -75.0), seen(24594, -179.0, 75.0, 4.0)]))
    assert (x, y) == pytest.approx((-0.75, 0.02), abs=1e-4)
    assert abs(heading) == pytest.approx(math.pi)


def test_a_mark_right_above_counts_more_and_more_marks_are_surer() -> None:
    near, far = seen(24706, 0.0, 0.0, 0.0), seen(24594, 0.0, 160.0, 0.0)
    (x, _, _, both), = poses(wire.multi([near, far]))
    assert 0.0 < x < 0.045  # they say 0 and 0.1 m
    (_, _, _, one), = poses(wire.multi([near]))
    (_, _, _, beside), = poses(wire.multi([far]))
    assert one.pose.covariance[0] == pytest.approx(1e-4)
    assert one.pose.covariance[35] == pytest.approx(0.0175 ** 2)
    assert both.pose.covariance[0] < one.pose.covariance[0] < beside.pose.covariance[0]


def test_a_wrong_heading_moves_a_base_far_from_the_sensor() -> None:
    with scripted(StarGazer, [wire.multi([seen()])], landmarks=ROOM,
                  mounting_m=[1.0, 0.0, 0.0]) as (device, (out,)):
        device.read(1)
        covariance = out.samples[0].pose.covariance.reshape(6, 6)
    turn = 0.0175 ** 2
    assert covariance[0, 0] == pytest.approx(1e-4)
    assert covariance[1, 1] == pytest.approx(1e-4 + turn)
    assert covariance[1, 5] == covariance[5, 1] == pytest.approx(-turn)


def test_a_dead_zone_is_no_fix_and_no_fault() -> None:
    with scripted(StarGazer, [b'~*DeadZone`' * 3], landmarks=ROOM) as (device, (out,)):
        device.read(1_000)
        statistics = device.statistics()
    assert not out.samples
    assert (statistics.frames, statistics.last_frame_ns) == (3, 1_000)
    assert (statistics.more['dead_zone'], statistics.more['dead_zone_sentences']) == ('true', 3)
    assert 'no mark is in sight' in device.unused()


def test_unknown_marks_are_counted_and_named_and_the_known_one_is_used() -> None:
    data = wire.multi([seen(7), seen(x_cm=10.0)]) + wire.multi([seen(5)])
    with scripted(StarGazer, [data], landmarks=ROOM) as (device, (out,)):
        assert device.read(1) == 1
        more = device.statistics().more
    assert (more['unknown_marks'], more['unknown_mark_ids']) == (2, '5, 7')
    assert 'it detects the marks 5, 7, which are not on the map' in device.unused()


def test_strange_numbers_are_kept_for_the_frequent_ones_only() -> None:
    noise = random.Random(1)
    data = [wire.multi([seen(99)]) + wire.multi([seen(noise.randrange(100_000))])
            for _ in range(200)]
    with scripted(StarGazer, data, landmarks=ROOM) as (device, _):
        for _ in data:
            device.read(1)
        named = str(device.statistics().more['unknown_mark_ids']).split(', ')
    assert len(named) == 16 and '99' in named


def test_without_landmarks_the_first_mark_is_the_origin() -> None:
    data = wire.multi([seen(7, x_cm=10.0)]), wire.multi([seen(8)]), wire.multi([seen(7)])
    assert [found[:2] for found in poses(*data, landmarks=[])] == [
        pytest.approx((0.1, 0.0)), pytest.approx((0.0, 0.0))]


def test_in_map_mode_positions_are_below_the_reference() -> None:
    data = wire.multi([seen(48, 0.0, 50.0)])
    changes = {'mark_mode': 'Map', 'reference_id': 24594}
    assert pose(data, **changes) == pytest.approx((-1.0, 0.0, 0.0))
    assert pose(data, landmarks=[], **changes) == pytest.approx((0.5, 0.0, 0.0))
    with pytest.raises(ConfigError, match='gazer: reference_id 5 is not among landmarks'):
        StarGazer('gazer', settings_of(StarGazer, port='x', landmarks=ROOM, mark_mode='Map',
                                       reference_id=5))


def test_what_it_sends_while_it_builds_its_map_is_no_pose() -> None:
    with scripted(StarGazer, [wire.single(seen(), 'F')], landmarks=ROOM) as (device, (out,)):
        assert device.read(1) == 0
        assert device.statistics().more['mode'] == 'building a map'
        assert 'move it slowly from mark to mark' in device.unused()


# --- marks that contradict each other --------------------------------------------------------

FOUR = [*ROOM, '64: 0, 1, 0']


def test_one_of_three_marks_is_left_out() -> None:
    good = [seen(24706, 0.0, 10.0), seen(24594, 0.0, 160.0)]
    wrong = seen(64, 90.0, 10.0, -100.0)
    with scripted(StarGazer, [wire.multi([wrong, *good])], landmarks=FOUR) as (device, (out,)):
        device.read(1)
        assert device.statistics().more['marks_left_out'] == 1
    assert out.samples[0].pose.pose.position.x == pytest.approx(0.1)
    assert out.samples[0].pose.pose.orientation.w == pytest.approx(1.0)


def test_of_two_the_one_that_goes_on_from_before_is_used() -> None:
    one, other = seen(24706, 0.0, 10.0), seen(24594, 0.0, 500.0)
    found = poses(wire.multi([one]), wire.multi([other, one]))
    assert found[1][0] == pytest.approx(0.1)


def test_two_that_contradict_each_other_and_nothing_before_are_no_pose() -> None:
    data = wire.multi([seen(24706, 0.0, 10.0), seen(24594, 0.0, 500.0)])
    with scripted(StarGazer, [data], landmarks=ROOM) as (device, (out,)):
        assert device.read(1) == 0
        assert device.statistics().contradicted_samples == 1


def test_a_mark_that_hangs_elsewhere_is_named_and_the_others_are_not() -> None:
    wrong = seen(64, 0.0, 0.0, -10.0)  # says y = 0.9, the others y = 0
    pairs = [[seen(24706), wrong], [seen(24594, 0.0, 150.0), wrong],
             [seen(24706), seen(24594, 0.0, 150.0)]]
    data = [wire.multi(pair) for pair in pairs * 30]
    with scripted(StarGazer, data, landmarks=FOUR) as (device, _):
        for number in range(len(data)):
            device.read(number * 50 * MS)
        assert device.statistics().more['disagreeing_mark_ids'] == '64'


def test_a_mark_that_disagrees_with_the_one_before_it_is_noticed_too() -> None:
    # One at a time: the robot stands still between three marks, of which one hangs elsewhere.
    turn = [seen(24706), seen(64, 0.0, 0.0, -300.0), seen(24594, 0.0, 150.0)]
    data = [wire.multi([mark]) for mark in turn * 60]
    with scripted(StarGazer, data, landmarks=FOUR) as (device, _):
        for number in range(len(data)):
            device.read(number * 50 * MS)
        assert device.statistics().more['disagreeing_mark_ids'] == '64'


@settings(max_examples=60, deadline=None)
@given(x=st.floats(-1, 1), y=st.floats(-1, 1), heading=st.floats(-3.1, 3.1),
       numbers=st.sets(st.sampled_from((24706, 24594, 48)), min_size=1))
def test_marks_of_one_place_say_that_place(
        x: float, y: float, heading: float, numbers: set[int]) -> None:
    hang = {24706: (0.0, 0.0, 0.0), 24594: (-1.5, 0.0, 0.0), 48: (1.0, 2.0, math.pi / 2)}
    marks = []
    for number in sorted(numbers):
        mark_x, mark_y, yaw = hang[number]
        dx, dy = x - mark_x, y - mark_y
        angle = math.remainder(heading - yaw, math.tau)
        marks.append(seen(number, -math.degrees(angle),
                          100 * (math.cos(yaw) * dx + math.sin(yaw) * dy),
                          100 * (math.cos(yaw) * dy - math.sin(yaw) * dx)))
    found = pose(wire.multi(marks))
    assert found == pytest.approx((x, y, heading), abs=2e-4)


# --- settings ------------------------------------------------------------------------------------

@pytest.mark.parametrize('changes, said', [
    ({'landmarks': ['7: 0']}, "gazer: landmarks, '7: 0': must be a number"),
    ({'landmarks_file': '/there/is/none.csv'}, 'gazer: landmarks_file .* No such file'),
    ({'landmarks_file': 'https://a/b.csv'}, 'gazer: landmarks_file .* give a path, file://'),
    ({'procedure': 'map_building'}, 'gazer: procedure map_building needs configure: true')])
def test_settings_that_cannot_be_are_refused(changes: Any, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        StarGazer('gazer', settings_of(StarGazer, port='x', **changes))


def test_a_file_of_landmarks(tmp_path: Path) -> None:
    file = tmp_path / 'room.csv'
    file.write_text('id,x_cm,y_cm,yaw_deg\n10546,-326,545,90\n')
    data = wire.multi([seen(10546, 0.0, 100.0)])
    assert pose(data, landmarks_file=str(file)) == pytest.approx((-3.26, 6.45, math.pi / 2))
    with pytest.raises(ConfigError, match='both contain 10546: delete one'):
        StarGazer('gazer', settings_of(StarGazer, port='x', landmarks_file=f'file://{file}',
                                       landmarks=['10546: 0 0']))


def test_the_latency_is_taken_off_the_stamp() -> None:
    with scripted(StarGazer, [wire.multi([seen()])], landmarks=ROOM, latency_s=0.05) as (
            device, (out,)):
        device.read(1000 * MS)
        assert out.stamps == [950 * MS]


def test_without_configure_nothing_is_sent() -> None:
    with scripted(StarGazer, [wire.multi([seen()])], landmarks=ROOM, mark_type='HLD1L') as (
            device, (out,)):
        for now in range(10):
            device.write(now * 1000 * MS)
        assert device.read(1) == 1
        port: Any = device._port
        assert port.written == []


def test_a_device_that_never_answers_is_an_error() -> None:
    with scripted(StarGazer, [], configure=True) as (device, _), pytest.raises(
            DeviceError, match='dut: it does not acknowledge CalcStop .10 tries.: check the wire'):
        for now in range(0, 60_000 * MS, 10 * MS):
            device.write(now)
