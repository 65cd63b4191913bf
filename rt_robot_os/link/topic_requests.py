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

"""The requests about topics: list, mirror, advertise, and ask for readers."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import asdict
import os

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.link.client import topic_infos
from rt_robot_os.link.gather import Gather
from rt_robot_os.link.large import LargeMirror
from rt_robot_os.link.large import memory_bytes
from rt_robot_os.link.liveness import LivenessPage
from rt_robot_os.link.mirror import DELAY_MAXIMUM_MS
from rt_robot_os.link.mirror import Mirror
from rt_robot_os.link.mirror import Policy
from rt_robot_os.link.protocol import SAMPLE_BYTES_MAXIMUM
from rt_robot_os.link.requests import Arguments
from rt_robot_os.link.requests import number_argument
from rt_robot_os.link.requests import Requests
from rt_robot_os.link.requests import shown
from rt_robot_os.link.requests import string_argument
from rt_robot_os.link.session import ClientSession
from rt_robot_os.topics import Bus

NAME_MAXIMUM = 64


class TopicRequests:
    """
    Answer the requests that need only the link.

    :param service: the task that sends mirrored topics.
    :param page: the liveness page, which is sent to a client with the answer to its hello.
    :param sessions: returns the connected clients.
    """

    def __init__(self, kernel: Kernel, bus: Bus, service: Task, gather: Gather, page: LivenessPage,
                 sessions: Callable[[], Sequence[ClientSession]]) -> None:
        self._kernel = kernel
        self._bus = bus
        self._service = service
        self._gather = gather
        self._page = page
        self._sessions = sessions

    def serve(self, requests: Requests) -> None:
        """Register the requests."""
        requests.add('hello', self._hello)
        requests.add('mirror', self._mirror)
        requests.add('unmirror', self._unmirror)
        requests.add('advertise', self._advertise)
        requests.add('readers', self._readers)

    def _hello(self, session: ClientSession, arguments: Arguments) -> Arguments:
        name = arguments.get('name')
        if not isinstance(name, str):
            raise LinkError(f'name = {shown(name)}: must be a string')
        session.greet(safe_line(name, NAME_MAXIMUM), self._page.fd)
        return {'pid': os.getpid(), 'start_ns': self._kernel.start_ns,
                'tasks': [task.name for task in self._kernel.tasks],
                'topics': [asdict(each) for each in topic_infos(self._bus)]}

    def _mirror(self, session: ClientSession, arguments: Arguments) -> Arguments:
        """Start to send a topic to a client, or change how; see ``LinkClient.mirror``."""
        topic = string_argument(arguments, 'topic')
        wanted = arguments.get('policy', 'drain')
        try:
            policy = Policy(wanted)
        except ValueError:
            raise LinkError(f'policy = {shown(wanted)}: must be drain or latest') from None
        max_rate_hz = number_argument(arguments, 'max_rate_hz', 0.0)
        delay_ms = number_argument(arguments, 'delay_ms', 0.0)
        if delay_ms > DELAY_MAXIMUM_MS:
            raise LinkError(f'delay_ms = {delay_ms:g}: must be at most {DELAY_MAXIMUM_MS:g}')
        channel = session.channel(topic)
        known = session.mirrors.get(topic)
        if known is not None:
            known.set_policy(policy, max_rate_hz, delay_ms)
            return {'channel': channel}
        shape = (self._bus, topic, session.name, session.batch, channel, policy, max_rate_hz,
                 bool(arguments.get('initial', False)), self._gather)
        size = self._bus.topic(topic).layout.max_size
        if size <= SAMPLE_BYTES_MAXIMUM:
            session.mirrors[topic] = Mirror(*shape)
        else:
            session.add_large(topic, lambda number: LargeMirror(
                *shape, number=number, connection=session.connection), memory_bytes(size))
        mirror = session.mirrors[topic]
        mirror.set_policy(policy, max_rate_hz, delay_ms)
        mirror.patient = bool(arguments.get('patient', False))
        if arguments.get('oldest', False):
            mirror.begin_with_oldest()
            self._kernel.release(self._service)
        return {'channel': channel}

    def _unmirror(self, session: ClientSession, arguments: Arguments) -> Arguments:
        session.remove_mirror(string_argument(arguments, 'topic'))
        return {}

    def _advertise(self, session: ClientSession, arguments: Arguments) -> Arguments:
        channel, is_large = session.advertise(string_argument(arguments, 'topic'))
        return {'channel': channel, 'room': is_large}

    def _readers(self, session: ClientSession, arguments: Arguments) -> Arguments:
        """Return the readers of a topic; see ``LinkClient.readers``."""
        topic = self._bus.topic(string_argument(arguments, 'topic'))
        answers = str(arguments.get('answers') or '')
        channel = session.channel(answers) if answers else -1
        found = [each for each in self._sessions() if each.reads(topic.name)
                 and (channel < 0 or each.publishes(channel))]
        return {'in_core': topic.counted, 'asker': session in found,
                'clients': [[each.name, each.pid, each.since_ns] for each in found
                            if each is not session]}
