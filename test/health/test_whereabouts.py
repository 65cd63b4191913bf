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


"""Where people are, and what follows from where they are and whether they move."""

from __future__ import annotations

from collections.abc import Callable
import json
from typing import Any

import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.health.whereabouts import Whereabouts
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.network_rows import NodeRow
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.module_bench import ModuleBench
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription

S = 10**9
FLOAT = 'std_msgs/msg/Float64'
POSE = 'geometry_msgs/msg/PoseStamped'
NODES = ['hall 1 1 2 id 1 presence', 'kitchen 8 1 2 id 2 presence', 'bed 8 7 1 id 3 temperature',
         'door 1 7 2 id 4 presence', 'wrist 5 5 1 id 9 on anna nearest_node acceleration_g']
ROOMS = ['hall 0 0 4 4', 'kitchen 6 0 10 4', 'sleeping 6 5 10 9', 'entry 0 5 4 9']


class Flat:
    """The topics of a flat, with samples at times."""

    def __init__(self, bench: ModuleBench) -> None:
        self.bench = bench
        self.presence = {name: bench.topic(f'wsn/{name}/presence', FLOAT)
                         for name in ('hall', 'kitchen', 'door')}
        self.nearest = bench.topic('wsn/wrist/nearest_node', FLOAT)
        self.shake = bench.topic('wsn/wrist/acceleration_g', FLOAT)

    def add(self, person: str = 'anna', **settings: Any) -> Whereabouts:
        return self.bench.add(Whereabouts, person, rate_hz=1.0, person=person,
                              **{'nodes': NODES, 'rooms': ROOMS, **settings})

    def at(self, time_s: float, publisher: Publisher, value: float) -> None:
        self.bench.at(time_s, put(publisher, value))

    def causes(self) -> Callable[[], list[tuple[float, str, bool]]]:
        read = self.bench.watch('alarms/causes')

        def told() -> list[tuple[float, str, bool]]:
            found, active = [], set()
            while read.take():
                cause = Cause.from_json(read.msg.data)
                if cause.active != (cause.kind in active):
                    (active.add if cause.active else active.discard)(cause.kind)
                    found.append((read.stamp_ns / S, cause.kind, cause.active))
            return found
        return told


def put(publisher: Publisher, value: float) -> Callable[[], None]:
    def publish() -> None:
        publisher.msg.data = value
        publisher.publish()
    return publish


def places(read: Subscription) -> list[tuple[float, float, float]]:
    found = []
    while read.take():
        position = read.msg.pose.position
        found.append((read.stamp_ns / S, position.x, position.y))
    return found


def newest(read: Subscription) -> dict[str, str]:
    assert read.latest()
    values: dict[str, str] = json.loads(read.msg.data)['status'][0]['values']
    return values


def test_the_nodes_that_are_heard_best_lately_tell_the_place() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        flat.add()
        place, details = bench.watch('health/anna/place'), bench.watch('health/anna/place_details')
        for time, number in enumerate([2, 2, 2, 99, *[3] * 10]):
            flat.at(1.0 + time, flat.nearest, number)
        bench.run(20.0)
        found = places(place)
        assert {each[1:] for each in found if each[0] < 4.5} == {(8.0, 1.0)}
        ys = [each[2] for each in found]
        assert ys == sorted(ys) and ys[-1] > 6.0  # to the bed, in steps
        assert newest(details)['how'] == 'node' and newest_message(details) == 'sleeping'


def test_who_lies_between_two_nodes_is_between_them_and_stays_there() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        flat.add()
        place = bench.watch('health/anna/place')
        for time in range(200):
            flat.at(1.0 + time, flat.nearest, 2 if (time * 7) % 5 < 3 else 3)
        bench.run(220.0)
        lately = {each[1:] for each in places(place) if each[0] > 20.0}
        assert len(lately) == 1
        x, y = lately.pop()
        assert x == 8.0 and 2.0 < y < 5.0


def newest_message(read: Subscription) -> str:
    return str(json.loads(read.msg.data)['status'][0]['message'])


def test_a_localisation_of_ros_is_preferred_while_it_is_fresh() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        pose = bench.topic('anna_pose', POSE, {'header.frame_id': 'map'})
        flat.add(pose_topic='anna_pose')
        place = bench.watch('health/anna/place')

        def here() -> None:
            pose.msg.pose.position.x, pose.msg.pose.position.y = 2.5, 2.0
            pose.publish()
        bench.at(1.0, here)
        for time in (2.5, 5.5, 9.5, 20.5):
            flat.at(time, flat.nearest, 2)
        bench.run(21.0)
        found = places(place)
        assert (1.0, 2.5, 2.0) in found
        assert {each[1:] for each in found if each[0] < 10.0} == {(2.5, 2.0)}
        assert found[-1][1:] == (8.0, 1.0)


class Robot:
    """A robot that sees anna, or what it takes for her."""

    def __init__(self, flat: Flat) -> None:
        self._bench = flat.bench
        self._seen = flat.bench.topic('health/anna/seen', POSE, {'header.frame_id': 'map'})

    def sees(self, time_s: float, x: float, y: float) -> None:
        def publish() -> None:
            self._seen.msg.pose.position.x, self._seen.msg.pose.position.y = x, y
            self._seen.publish()
        self._bench.at(time_s, publish)


def test_what_the_robot_sees_is_preferred_while_it_is_fresh_and_nodes_win_again() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        robot = Robot(flat)
        flat.add(seen_topic='health/anna/seen')
        place, by_nodes = bench.watch('health/anna/place'), bench.watch(
            'health/anna/place_by_nodes')
        for time in range(1, 30):
            flat.at(time, flat.nearest, 2)
        for time in range(5, 9):
            robot.sees(time + 0.5, 6.5, 2.5)
        bench.run(30.0)
        found = places(place)
        assert {each[1:] for each in found if each[0] < 5.2} == {(8.0, 1.0)}
        assert {each[1:] for each in found if 5.5 <= each[0] <= 8.5} == {(6.5, 2.5)}
        assert {each[1:] for each in found if each[0] > 22.0} == {(8.0, 1.0)}
        # The robot looks for her round what nodes say, never round what it said itself.
        assert {each[1:] for each in places(by_nodes)} == {(8.0, 1.0)}


def test_who_is_heard_in_another_room_is_there_whatever_the_robot_saw_before() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        robot = Robot(flat)
        flat.add('anna', seen_topic='health/anna/seen', nodes=NODES[:4])
        place = bench.watch('health/anna/place')
        flat.at(1.0, flat.presence['hall'], 1.0)
        for time in (2.0, 3.0, 4.0):
            robot.sees(time, 2.0, 2.5)
        flat.at(7.0, flat.presence['kitchen'], 1.0)
        bench.run(9.0)
        found = places(place)
        assert found[-2][1:] == (2.0, 2.5)
        assert found[-1] == (7.0, 8.0, 1.0)


def test_what_the_robot_takes_for_her_does_not_veto_where_she_is_noticed() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        robot = Robot(flat)
        flat.add(seen_topic='health/anna/seen', nodes=NODES[:4], presence_range_m=3.0)
        by_nodes = bench.watch('health/anna/place_by_nodes')
        flat.at(1.0, flat.presence['hall'], 1.0)
        for time in range(2, 30):
            robot.sees(time, 2.0, 2.5)      # a chair
        flat.at(20.0, flat.presence['kitchen'], 1.0)
        bench.run(30.0)
        assert [each[1:] for each in places(by_nodes)] == [(1.0, 1.0), (8.0, 1.0)]


def test_to_be_seen_by_the_robot_is_no_movement() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        robot = Robot(flat)
        flat.add(seen_topic='health/anna/seen', still_s=100.0)
        causes = flat.causes()
        for time in range(1, 200):
            flat.at(time, flat.nearest, 2)
        for time in range(50, 150):
            robot.sees(time + 0.5, 6.5 + 0.6 * (time % 2), 2.5)
        bench.run(200.0)
        assert [each[1:] for each in causes()] == [('no_movement', True)]


def test_presence_is_of_whom_it_can_be() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        bob_at = bench.topic('health/bob/place', POSE, {'header.frame_id': 'map'})
        module = flat.add(others=['bob'], presence_range_m=3.0)
        place = bench.watch('health/anna/place')

        def bob() -> None:
            bob_at.msg.pose.position.x, bob_at.msg.pose.position.y = 8.5, 1.0
            bob_at.publish()
        bench.at(1.0, bob)
        flat.at(2.0, flat.presence['hall'], 1.0)      # anna: bob is in the kitchen
        flat.at(3.0, flat.presence['kitchen'], 1.0)   # bob
        flat.at(4.0, flat.presence['hall'], 0.0)
        bench.run(6.0)
        assert {each[1:] for each in places(place)} == {(1.0, 1.0)}
        assert module.statistics()['presence_of_others'] == 1


def test_nobody_is_at_both_ends_of_the_flat_within_a_second() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        flat.add(presence_range_m=2.0)
        place = bench.watch('health/anna/place')
        flat.at(2.0, flat.presence['hall'], 1.0)
        flat.at(2.5, flat.presence['kitchen'], 1.0)   # somebody else, whoever that is
        flat.at(9.0, flat.presence['kitchen'], 1.0)
        bench.run(10.0)
        assert [each[1:] for each in places(place)] == [(1.0, 1.0), (8.0, 1.0)]


def test_a_worn_node_knows_whose_presence_it_is() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        bob_at = bench.topic('health/bob/place', POSE, {'header.frame_id': 'map'})
        flat.add(others=['bob'], still_s=30.0)
        place, told = bench.watch('health/anna/place'), flat.causes()

        def bob() -> None:  # who comes to her, and walks about
            bob_at.msg.pose.position.x, bob_at.msg.pose.position.y = 7.0, 1.0
            bob_at.publish()
        for time in range(1, 50, 4):
            flat.at(time, flat.nearest, 2)
            bench.at(time + 0.1, bob)
            flat.at(time + 0.2, flat.presence['hall'], 1.0)
            flat.at(time + 0.3, flat.presence['kitchen'], 1.0)
        bench.run(50.0)
        assert {each[1:] for each in places(place)} == {(8.0, 1.0)}
        assert told() == [(31.0, 'no_movement', True)]


def test_whom_a_worn_node_sends_to_tells_roughly() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        nodes = bench.bus.declare('wsn/nodes', 'std_msgs/msg/Float64MultiArray', tail=200)
        out = bench.bus.publisher('wsn/nodes')
        flat.add(network_topic='wsn/nodes')
        place, details = bench.watch('health/anna/place'), bench.watch('health/anna/place_details')
        row = NodeRow(9, 5, 5, 1, 0, 3, 2, 2, 1, 2.9, 100, 1, 1, 10, 0, 0, 0, 1.0)

        def rows() -> None:
            out.msg.data = list(row)
            out.publish()
        bench.at(5.0, rows)
        bench.run(8.0)
        assert nodes.layout.tail == 'data'
        assert places(place) == [(4.0, 8.0, 7.0)]
        assert newest(details)['how'] == 'network'


def test_who_does_not_move_for_too_long_is_told_and_one_twitch_does_not_end_it() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        flat.add(still_s=100.0, movement=['wsn/wrist/acceleration_g.data moves 0.1 within 5 s'])
        told = flat.causes()
        for time in range(0, 400, 2):
            # It moves until 20 s, once at 200 s, and again from 300 s on.
            moving = time <= 20 or time == 200 or time >= 300
            flat.at(time + 0.5, flat.shake, 1.0 + 0.2 * (time // 2 % 2 or time == 200) * moving)
            flat.at(time + 0.5, flat.nearest, 2)
        bench.run(400.0)
        (began, kind, active), (ended, _, over) = told()
        assert (kind, active, over) == ('no_movement', True, False)
        assert 120.0 < began < 130.0 and 300.0 < ended < 335.0


def test_in_bed_one_may_lie_for_longer() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        flat.add(still_s=100.0, still=['sleeping 300 s'])
        told = flat.causes()
        for time in range(0, 500, 5):
            flat.at(time + 0.25, flat.nearest, 3)
        bench.run(500.0)
        assert told() == [(300.25, 'no_movement', True)]


def test_sensors_that_are_silent_say_nothing_about_a_person() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        flat.add(still_s=1000.0, stay=['kitchen 1000 s'], blind_s=300.0)
        told = flat.causes()
        for time in (*range(0, 600, 50), *range(1500, 1900, 50)):
            flat.at(time + 0.25, flat.nearest, 2)
        bench.run(1950.0)
        # Since it is heard again she may have walked about: only the room is as it was.
        assert told() == [(1500.25, 'wandering', True)]


def test_too_long_in_a_room_is_over_in_another_one() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        flat.add(stay=['kitchen 60 s'])
        told = flat.causes()
        for time in range(0, 200, 5):
            flat.at(time + 0.25, flat.nearest, 2 if time < 100 else 3)
        bench.run(200.0)
        (began, kind, _), (ended, _, over) = told()
        assert (began, kind, over) == (60.25, 'wandering', False)
        assert 110.0 <= ended <= 140.0


def test_who_was_seen_at_the_door_last_has_left() -> None:
    with ModuleBench() as bench:
        flat = Flat(bench)
        flat.add(still_s=60.0, exits=['door'], away_s=120.0)
        told = flat.causes()
        flat.at(1.0, flat.presence['hall'], 1.0)
        flat.at(10.0, flat.presence['door'], 1.0)
        for time in range(20, 400, 10):
            flat.at(float(time), flat.presence['kitchen'], 0.0)
        flat.at(400.0, flat.presence['door'], 1.0)
        flat.at(405.0, flat.presence['hall'], 1.0)
        bench.run(410.0)
        # Not "no movement": nobody is there who could move.
        assert told() == [(130.0, 'left_home', True), (405.0, 'left_home', False)]


@pytest.mark.parametrize('settings, told', [
    ({'person': 'an na'}, 'anna.person'),
    ({'rooms': ['kitchen 0 0 3']}, 'is not a room: write a name and two corners'),
    ({'rooms': ['kitchen 3 0 0 4']}, 'the lower left one first'),
    ({'still': ['attic 2 h']},
     "unknown room 'attic', must be one of the setting rooms: entry, hall, kitchen"),
    ({'still': ['hall forever']}, "'forever' is not a duration"),
    ({'exits': ['gate']}, "unknown node 'gate'"),
    ({'away_s': 60.0}, 'name the nodes at the exits'),
    ({'others': ['anna']}, 'remove it'),
    ({'movement': ['wsn/wrist/x.data moves']}, 'anna.movement: the end is not valid here'),
])
def test_settings_that_cannot_be_are_refused(settings: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        Whereabouts('anna', settings_of(Whereabouts, **{
            'person': 'anna', 'nodes': NODES, 'rooms': ROOMS, **settings}))
