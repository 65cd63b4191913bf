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

"""Topics: publish/subscribe inside the core, wait-free and without conversion."""

from rt_robot_os.topics.bus import Bus
from rt_robot_os.topics.layout import Layout
from rt_robot_os.topics.publisher import LargePublisher
from rt_robot_os.topics.publisher import Publisher
from rt_robot_os.topics.subscription import ReadStatus
from rt_robot_os.topics.subscription import Subscription
from rt_robot_os.topics.topic import MAX_SUBSCRIBERS
from rt_robot_os.topics.topic import SubscriberStatistics
from rt_robot_os.topics.topic import Topic
from rt_robot_os.topics.topic import TopicStatistics
from rt_robot_os.topics.topic import Trigger

__all__ = ['Bus', 'LargePublisher', 'Layout', 'MAX_SUBSCRIBERS', 'Publisher', 'ReadStatus',
           'SubscriberStatistics', 'Subscription', 'Topic', 'TopicStatistics', 'Trigger']
