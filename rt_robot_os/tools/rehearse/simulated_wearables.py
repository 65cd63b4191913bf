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

"""The wearables in scenarios: inertial sensors and oximeters, as in the settings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.settings import RobotSettings
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world.body_motion import body_motion
from rt_robot_os.sim.world.people import SimulatedPerson
from rt_robot_os.sim.world.vitals import SIGNS
from rt_robot_os.tools.rehearse.fixture import CoreFixture

_IMU: Final = 'sensor_msgs/msg/Imu'
_FLOAT: Final = 'std_msgs/msg/Float64'
_ON: Final = 'on'


class SimulatedWearables:
    """
    Simulates the devices that are ``on`` a person.

    :param settings: of the robot, with the devices and their topics.
    :param world: the world with the people.
    :ivar off: names of people whose devices publish nothing.
    """

    def __init__(self, settings: RobotSettings, world: World) -> None:
        people = {person.name: person for person in world.people}
        self._world = world
        self.off: set[str] = set()
        self._worn = [
            (people[device.sim[_ON]], spec.topic, spec.message)
            for device in settings.devices if device.sim and device.sim.get(_ON) in people
            for spec in DRIVERS.load(device.type)(device.name, device.settings).publications()]

    def attach(self, fixture: CoreFixture) -> None:
        """Find the topics."""
        self._steps: list[tuple[SimulatedPerson, Callable[[int], None]]] = []
        for person, topic, message in self._worn:
            sign = topic.rpartition('/')[2]
            if message == _IMU:
                self._steps.append((person, self._inertial(fixture, person, topic)))
            elif message == _FLOAT and sign in SIGNS:
                self._steps.append((person, self._monitor(fixture, person, topic, sign)))

    def step(self, now_ns: int) -> None:
        """Publish the readings of each."""
        for person, publish in self._steps:
            if person.name not in self.off:
                publish(now_ns)

    def _inertial(self, fixture: CoreFixture, person: SimulatedPerson,
                  topic: str) -> Callable[[int], None]:
        publisher = fixture.publisher(topic)

        def publish(now_ns: int) -> None:
            if publisher is None:
                return
            felt = body_motion(person.activity, self._world.time_s - person.activity_since_s,
                               before=person.activity_before)
            publisher.msg.linear_acceleration = felt.force_m_s2
            publisher.msg.angular_velocity = felt.rate_rad_s
            publisher.publish(now_ns)

        return publish

    def _monitor(self, fixture: CoreFixture, person: SimulatedPerson, topic: str, sign: str
                 ) -> Callable[[int], None]:
        publisher = fixture.publisher(topic)

        def publish(now_ns: int) -> None:
            if publisher is not None and now_ns % NS_PER_S == 0:
                value = person.vitals.value(sign, person.time_s)
                if value:  # a monitor with a detached sensor publishes nothing
                    publisher.msg.data = value
                    publisher.publish(now_ns)

        return publish
