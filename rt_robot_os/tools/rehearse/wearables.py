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

"""What people wear on the stage: inertial sensors and oximeters, as the settings have them."""

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
from rt_robot_os.tools.rehearse.stage import Stage

_IMU: Final = 'sensor_msgs/msg/Imu'
_FLOAT: Final = 'std_msgs/msg/Float64'
_ON: Final = 'on'


class Wearables:
    """
    Plays the devices that are ``on`` somebody.

    :param settings: of the robot: which devices there are, and their topics.
    :param world: with the people.
    :ivar off: names of people whose devices say nothing.
    """

    def __init__(self, settings: RobotSettings, world: World) -> None:
        people = {person.name: person for person in world.people}
        self._world = world
        self.off: set[str] = set()
        self._worn = [
            (people[device.sim[_ON]], spec.topic, spec.message)
            for device in settings.devices if device.sim and device.sim.get(_ON) in people
            for spec in DRIVERS.load(device.type)(device.name, device.settings).publications()]

    def enter(self, stage: Stage) -> None:
        """Find the topics."""
        self._acts: list[tuple[SimulatedPerson, Callable[[int], None]]] = []
        for person, topic, message in self._worn:
            sign = topic.rpartition('/')[2]
            if message == _IMU:
                self._acts.append((person, self._inertial(stage, person, topic)))
            elif message == _FLOAT and sign in SIGNS:
                self._acts.append((person, self._monitor(stage, person, topic, sign)))

    def act(self, now_ns: int) -> None:
        """Publish what each feels."""
        for person, act in self._acts:
            if person.name not in self.off:
                act(now_ns)

    def _inertial(self, stage: Stage, person: SimulatedPerson, topic: str) -> Callable[[int],
                                                                                       None]:
        publisher = stage.publisher(topic)

        def act(now_ns: int) -> None:
            if publisher is None:
                return
            felt = body_motion(person.activity, self._world.time_s - person.activity_since_s,
                               before=person.activity_before)
            publisher.msg.linear_acceleration = felt.force_m_s2
            publisher.msg.angular_velocity = felt.rate_rad_s
            publisher.publish(now_ns)

        return act

    def _monitor(self, stage: Stage, person: SimulatedPerson, topic: str, sign: str
                 ) -> Callable[[int], None]:
        publisher = stage.publisher(topic)

        def act(now_ns: int) -> None:
            if publisher is not None and now_ns % NS_PER_S == 0:
                value = person.vitals.value(sign, person.time_s)
                if value:  # a monitor whose sensor is off says nothing here
                    publisher.msg.data = value
                    publisher.publish(now_ns)

        return act
