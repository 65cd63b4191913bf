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

"""HORUS (horus-robotics on PyPI), where it is installed: a Rust scheduler with Python nodes."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
import time
from typing import Any

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measured
from rt_robot_os.tools.bench.stamps import Stamps
from rt_robot_os.tools.bench.workers.delay import due
from rt_robot_os.tools.bench.workers.delay import key
from rt_robot_os.tools.bench.workers.delay import Receiver
from rt_robot_os.tools.bench.workers.delay import to_the_last
from rt_robot_os.tools.bench.workers.modules import collect
from rt_robot_os.tools.bench.workers.modules import make_modules
from rt_robot_os.tools.bench.workers.preemption import Work

_PRIORITY = 80
# Of its scheduler: the fastest node sets it, and no faster tick than it says it can do.
_TICK_MAXIMUM_HZ = 2000.0
_MESSAGE_MAXIMUM = 3000


def _node(name: str, tick: Callable[[], object], **options: Any) -> Any:
    return import_module('horus').Node(name=name, tick=lambda node: tick(), **options)


def modules(harness: Harness) -> Measured:
    """
    Run periodic modules, see :func:`rt_robot_os.tools.bench.workers.modules.kernel`.

    HORUS refuses two nodes on one CPU of their own: it may use all.
    """
    a = harness.arguments
    horus = import_module('horus')
    made = make_modules(a)
    order = sorted(range(len(made)), key=lambda i: -a['modules'][i][1])
    nodes = [_node(f'module{i}', made[i].work, rate=a['modules'][i][0], order=rank,
                   priority=min(_PRIORITY, a['modules'][i][1]))
             for rank, i in enumerate(order)]
    total_ns = a['warmup_ns'] + a['measure_ns']
    begin_ns, cpu_ns = time.monotonic_ns(), time.process_time_ns()
    horus.run(*nodes, rt=True, tick_rate=min(_TICK_MAXIMUM_HZ, max(r for r, _ in a['modules'])),
              duration=total_ns / NS_PER_S)
    used_ns, duration_ns = time.process_time_ns() - cpu_ns, time.monotonic_ns() - begin_ns
    return collect(made, begin_ns, a, used_ns, duration_ns)


def delay(harness: Harness) -> Measured:
    """
    Send dictionaries from a node to nodes that the topic triggers; larger ones are left out.

    A topic without a type carries no bytes, but what JSON can say: a string has the size.
    """
    a = harness.arguments
    samples: dict[str, Samples] = {}
    for size, subscribers in a['variants']:
        if size <= _MESSAGE_MAXIMUM:
            samples[key(size, subscribers)] = _delay(a, size, subscribers)
    return Measured(samples, {'due': due(a)})


def _delay(a: Any, size: int, subscribers: int) -> Samples:
    horus = import_module('horus')
    total_ns = a['warmup_ns'] + a['measure_ns']
    room = 2 * total_ns // a['period_ns'] + 100
    sent, receivers = Stamps(room), [Receiver(room) for _ in range(subscribers)]
    text, topic = 'x' * size, f'bench.{size}.{subscribers}'

    def publish(node: Any) -> None:
        message = {'n': sent.count, 'data': text}
        sent.stamp()
        node.send(topic, message)

    def receiving(receiver: Receiver) -> Callable[[Any], None]:
        def tick(node: Any) -> None:
            while message := node.recv(topic):
                receiver.note_number(message['n'])

        return tick

    rate_hz = NS_PER_S / a['period_ns']
    horus.run(
        horus.Node(name='publisher', tick=publish, rate=rate_hz, order=0, priority=_PRIORITY,
                   pubs=[topic]),
        *(horus.Node(name=f'receiver{i}', tick=receiving(receiver), on=topic, order=1,
                     subs=[topic]) for i, receiver in enumerate(receivers)),
        rt=True, tick_rate=rate_hz, duration=total_ns / NS_PER_S)
    return to_the_last(sent, receivers, a['warmup_ns'] // a['period_ns'])


def preemption(harness: Harness) -> Measured:
    """
    Run a fast node on the last CPU beside one that computes in HORUS's own thread pool.

    Its grid is not told: the earliest call gives it, so that latencies are a little too small.
    """
    a = harness.arguments
    horus = import_module('horus')
    work = Work(a)
    rate_hz = NS_PER_S / a['period_ns']
    nodes = [
        _node('fast', work.fast, rate=rate_hz, order=0, priority=_PRIORITY,
              core=harness.own_cpu),
        _node('computing', work.busy, rate=NS_PER_S / a['busy_period_ns'], order=5, compute=True)]
    if a['middle_period_ns']:
        nodes.append(_node('middle', work.middle, rate=NS_PER_S / a['middle_period_ns'], order=2,
                           priority=_PRIORITY // 2))
    horus.run(*nodes, rt=True, tick_rate=rate_hz, duration=work.total_ns / NS_PER_S)
    starts, period_ns = work.measured(0).samples['starts'], a['period_ns']
    if not len(starts):
        raise RuntimeError('HORUS never called its node')
    offsets = (starts - starts[0] + period_ns // 2) % period_ns - period_ns // 2
    # It starts its nodes one after the other: the end of the time is not theirs.
    return work.measured(int(starts[0] + offsets.min()),
                         measure_ns=a['measure_ns'] - NS_PER_S // 10)
