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
Services of the node: most publish a string in the core and return the answer of the core.

A call awaits its answer as a coroutine, so that the executor, and with it the mirrors, continues.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import suppress
import shlex
from typing import Any
from typing import Final

from nav_msgs.srv import LoadMap
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos import QoSReliabilityPolicy

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.programs import command_line
from rt_robot_os.link import LinkClient
from rt_robot_os.link.answers import answer_of
from rt_robot_os.link.reader import SampleHandler
from rt_robot_os.link.readers import no_answer
from rt_robot_os.messages.cdr import string_message
from rt_robot_os.messages.command_answer import CommandAnswer
from rt_robot_os.ros.map_service import MapService
from rt_robot_os.ros.mirrors import ask_for_all
from rt_robot_os.ros.service_call import Call
from rt_robot_os.ros.service_call import CHECK_S
from rt_robot_os.ros.service_call import Outcome
from rt_robot_os.settings import MirrorSettings
from rt_robot_os.settings.service_model import GET_MAP
from rt_robot_os.settings.service_model import LOAD_MAP
from rt_robot_os.settings.service_model import MAP_URL
from rt_robot_os.settings.service_model import ServiceSettings
from rt_robot_os.settings.service_model import SET_BOOL
from std_srvs.srv import SetBool
from std_srvs.srv import Trigger

#: The most calls of a service that may wait for their answers at the same time.
WAITING_MAXIMUM: Final = 16


# The default depth of 10 would drop simultaneous calls, which would never be answered.
_QUEUE: Final = 4 * WAITING_MAXIMUM


class Service:
    """
    One service.

    :ivar calls: number of calls.
    :ivar done: calls that succeeded: the answer said so, or, without an answer topic, the command
        was published and has a reader.
    :ivar refused: calls that were refused, or whose command could not be published.
    :ivar unanswered: calls with an unknown result.
    """

    def __init__(self, services: Services, settings: ServiceSettings,
                 group: ReentrantCallbackGroup) -> None:
        self.settings = settings
        self.calls = self.done = self.refused = self.unanswered = 0
        self.waiting: deque[Call] = deque()
        self._services = services
        self._channel = 0
        # A reader in the core exists as long as the connection: no request is needed.
        self._in_core = False
        self._client: LinkClient | None = None
        kind, callback = {SET_BOOL: (SetBool, self._on_bool), LOAD_MAP: (
            LoadMap, self._on_load)}.get(settings.type, (Trigger, self._on_trigger))
        self.entity = services.node.create_service(
            kind, settings.service, callback, callback_group=group, qos_profile=QoSProfile(
                depth=_QUEUE, reliability=QoSReliabilityPolicy.RELIABLE))

    def connect(self, client: LinkClient | None) -> None:
        """
        Set the connection; None ends all calls.

        :raises LinkError: the core refuses.
        """
        if client is not None:
            settings = self.settings
            self._channel = client.advertise(settings.topic)
            self._in_core = client.readers(settings.topic, settings.answer_topic).in_core > 0
        self._client = client
        if client is None:
            for call in list(self.waiting):
                call.fail('the core has ended before it answered')

    async def _on_trigger(self, request: Any, response: Any) -> Any:
        return await self._answered(self.settings.text, response)

    async def _on_bool(self, request: Any, response: Any) -> Any:
        settings = self.settings
        return await self._answered(settings.text if request.data else settings.text_false,
                                    response)

    async def _answered(self, text: str, response: Any) -> Any:
        outcome = await self._call(text)
        response.success, response.message = outcome.ok, outcome.text
        return response

    async def _on_load(self, request: Any, response: Any) -> Any:
        """Load a map; it is not in the response, but is published on the topic of the map."""
        url = request.map_url.strip()
        if url:
            answer = await self._call(self.settings.text.replace(MAP_URL, url))
        else:
            self.calls += 1
            self.refused += 1
            answer = Outcome(False, 'map_url is empty: such a file does not exist', answered=True)
        response.result = map_result(answer)
        if not answer.ok:
            # The response has no field for the reason.
            self._services.node.get_logger().warn(
                f'{self.entity.service_name}: {url!r} was not loaded: {answer.text}')
        return response

    async def _call(self, text: str) -> Outcome:
        self.calls += 1
        try:
            outcome = await self._ask(text)
        except LinkError as error:
            outcome = Outcome(False, str(error))
        self.done += outcome.ok
        self.refused += outcome.known and not outcome.ok
        self.unanswered += not outcome.known
        return outcome

    async def _ask(self, text: str) -> Outcome:
        """
        Publish a string and await the answer.

        :raises LinkError: it cannot be published.
        """
        client, services = self._client, self._services
        topic, answers = self.settings.topic, self.settings.answer_topic
        if client is None:
            raise LinkError('the node is not active, or no core is connected')
        if len(self.waiting) >= WAITING_MAXIMUM:
            raise LinkError(f'{len(self.waiting)} calls already wait for their answers')
        call = Call(text, services.wake, lambda: services.is_served_in_ros(self.settings))
        self.waiting.append(call)
        timers = [
            services.timer(self.settings.timeout_s,
                           lambda: call.time_out(self.settings.timeout_s)),
            services.timer(CHECK_S, lambda: call.check(client, topic, answers))]
        try:
            found = self._in_core or await call.find(client, topic, answers)
            if isinstance(found, Outcome):
                return found
            if not found:
                raise LinkError(services.not_served(self.settings))
            if answers:
                return await call.publish(
                    lambda: client.publish(self._channel, string_message(text)))
            client.publish(self._channel, string_message(text))
            return Outcome(True, f'published {text!r} on {topic}')
        finally:
            self.waiting.remove(call)
            for each in timers:
                services.node.destroy_timer(each)

    def receive(self, stamp_ns: int, answer: CommandAnswer) -> bool:
        """Deliver an answer to the call that has waited longest for it; return whether one did."""
        for call in list(self.waiting):
            if (call.is_open and answer.is_to(call.command)
                    and stamp_ns >= call.published_ns):
                call.end(Outcome(answer.ok, answer.text, answered=True))
                return True
        return False

    def counters(self) -> dict[str, Any]:
        """Return its counters for /diagnostics."""
        return {'calls': self.calls, 'done': self.done, 'refused': self.refused,
                'unanswered': self.unanswered, 'waiting': len(self.waiting)}


# Words in the answer when a map was not loaded, and the result codes of nav_msgs.
_RESULTS: Final = (('does not exist', LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST),
                   ('metadata', LoadMap.Response.RESULT_INVALID_MAP_METADATA),
                   ('yaml', LoadMap.Response.RESULT_INVALID_MAP_METADATA),
                   ('data', LoadMap.Response.RESULT_INVALID_MAP_DATA),
                   ('image', LoadMap.Response.RESULT_INVALID_MAP_DATA),
                   ('pgm', LoadMap.Response.RESULT_INVALID_MAP_DATA),
                   ('damaged', LoadMap.Response.RESULT_INVALID_MAP_DATA))


def map_result(answer: Outcome) -> int:
    """Return the result code of ``nav_msgs/srv/LoadMap`` for the outcome of a call."""
    if answer.ok:
        return int(LoadMap.Response.RESULT_SUCCESS)
    text = answer.text.lower() if answer.answered else ''
    return int(next((code for word, code in _RESULTS if word in text),
                    LoadMap.Response.RESULT_UNDEFINED_FAILURE))


class Services:
    """
    All services of a node; they exist as long as it does, and refuse calls while it is inactive.

    :param mirrors: of the node: they may send a command to a ROS node, and its answer back.
    :param files: parameter files of the robot, for the command that starts a missing process.
    :ivar malformed: answers that are not valid.
    """

    def __init__(self, node: Node, settings: tuple[ServiceSettings, ...],
                 mirrors: tuple[MirrorSettings, ...] = (), files: tuple[str, ...] = ()) -> None:
        self.node = node
        self._mirrors = mirrors
        self._files = files
        self.active = False
        self.malformed = 0
        # In a separate reentrant group: in the node's group, a call that awaits its answer would
        # block every mirror.
        self._group = ReentrantCallbackGroup()
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._client: LinkClient | None = None
        self.all = [Service(self, each, self._group) for each in settings if each.type != GET_MAP]
        self.maps = [MapService(node, each, self._group) for each in settings
                     if each.type == GET_MAP]
        self.answer_topics = frozenset(
            each.answer_topic for each in settings if each.answer_topic)

    def connect(self, client: LinkClient) -> None:
        """
        Set a new connection, after its mirrors were connected.

        :raises LinkError: the core refuses.
        """
        for topic in sorted(self.answer_topics):
            info = client.topics.get(topic)
            if info is None:
                raise LinkError(f'the core has no topic {topic!r} on which a service is answered; '
                                'was it started with another configuration?')
            mirrored = client.sample_handlers.get(info.channel)
            client.sample_handlers[info.channel] = self._listener(topic, mirrored)
        for each in self.maps:
            each.connect(client)
        self._client = client
        if self.active:
            self.activate()

    def activate(self) -> None:
        """
        Request the answers from the core, and serve calls.

        :raises LinkError: the core refuses.
        """
        self.active = True
        client = self._client
        if client is None:
            return
        for topic in sorted(self.answer_topics):
            ask_for_all(client, topic)
        for each_map in self.maps:
            each_map.activate(client)
        for each in self.all:
            each.connect(client)

    def deactivate(self) -> None:
        """Refuse calls from now on."""
        self.active = False
        for each in self.all:
            each.connect(None)

    def disconnect(self) -> None:
        """Drop the connection."""
        self._client = None
        for each in self.all:
            each.connect(None)

    def is_served_in_ros(self, settings: ServiceSettings) -> bool:
        """Return whether ROS nodes read the commands, and publish answers if there is a topic."""
        node = self.node

        def has_any(topic: str, direction: str, count: Callable[[str], int]) -> bool:
            return any(count(node.resolve_topic_name(each.ros_topic)) for each in self._mirrors
                       if each.topic == topic and each.direction == direction)

        return has_any(settings.topic, 'out', node.count_subscribers) and (
            not settings.answer_topic
            or has_any(settings.answer_topic, 'in', node.count_publishers))

    def not_served(self, settings: ServiceSettings) -> str:
        """Return the error that no process answers a service, and how to start it."""
        command = settings.started_by
        if command and ' ' not in command:
            files = ''.join(f' --params-file {shlex.quote(each)}' for each in self._files)
            command = (f'{command_line(command)} --robot {self.node.get_fully_qualified_name()}'
                       + (f' --ros-args{files}' if files else ''))
        return no_answer(settings.answer_topic or settings.topic, f'start it with: {command}' if (
            command) else 'start the process that answers it')

    def timer(self, period_s: float, callback: Callable[[], None]) -> Any:
        """Make a timer on a steady clock that other callbacks do not delay."""
        return self.node.create_timer(
            period_s, callback, callback_group=self._group, clock=self._steady)

    def wake(self) -> None:
        """Wake the executor, so that it resumes coroutines; thread-safe."""
        executor = self.node.executor
        if executor is not None:
            with suppress(InvalidHandle):  # it is being shut down
                executor.wake()

    def _listener(self, topic: str, mirrored: SampleHandler | None) -> SampleHandler:
        waiting = [each for each in self.all if each.settings.answer_topic == topic]

        def receive(stamp_ns: int, missed: int, cdr: memoryview) -> None:
            try:
                answer = answer_of(cdr)
                any(each.receive(stamp_ns, answer) for each in waiting)
            except ValueError:
                self.malformed += 1
            if mirrored is not None:
                mirrored(stamp_ns, missed, cdr)

        return receive

    def counters(self) -> list[tuple[str, dict[str, Any]]]:
        """Return the counters of all services, by their names."""
        return [*((each.entity.service_name, {**each.counters(), 'malformed': self.malformed})
                  for each in self.all),
                *((each.entity.service_name, each.counters()) for each in self.maps)]
