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

"""Which system for which requirement: what the figures say, and what no figure says."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence

from rt_robot_os.tools.bench.blocks import Block
from rt_robot_os.tools.bench.blocks import Bullets
from rt_robot_os.tools.bench.blocks import Heading
from rt_robot_os.tools.bench.blocks import Paragraph
from rt_robot_os.tools.bench.blocks import TableBlock
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Requirement
from rt_robot_os.tools.bench.text_report import fit
from rt_robot_os.tools.bench.text_report import SYSTEMS

INTRODUCTION = (
    'rt_robot_os runs the tasks of a robot in one Python process, the core: a more important task '
    'interrupts a less important one, whatever Python that runs. A ROS 2 node beside it mirrors '
    'its topics. Here it is compared with what else such tasks could be written in: rclpy, the '
    'Python library of ROS 2, with each of its executors; HORUS, a robot framework that has a '
    'Python interface; Python threads; and with bare loops that show the least this machine '
    'allows to any program.')
USE = (
    'Use rt_robot_os when a task has to be on time while other Python of the same program '
    'computes for longer than it may be late (case preemption), when tasks of one program hand '
    'messages on within microseconds (delay), or when serial devices have to be read in time '
    'under load (serial; where tasks of the program itself compute for long, the work queues of '
    'Linux have to be kept off its CPU for that).',
    'Do not use rt_robot_os when nothing in the program computes for longer than the others may '
    'be late: rclpy and threads keep the rates as well (frequency, load), and are one thing less '
    'to learn. Nor without the right to SCHED_FIFO: then every other process delays it; `doctor` '
    'says what is missing. Nor for work that has to use several CPUs: the core is one thread on '
    'one CPU.',
    'Use rclpy for services, actions, tf2, parameters of other nodes and all that has no '
    'deadline. The node of this package is an rclpy node, so that both can be had. Of the '
    'executors EventsExecutor, experimental in Jazzy, takes the least CPU; none of them, not the '
    'MultiThreadedExecutor either, interrupts a callback in time (preemption).',
    'Use threads for few tasks that may be some milliseconds late: Python hands over from a '
    'thread that computes after 5 ms, which is the p99 that the case preemption shows.',
    'Use HORUS where its own tools are wanted, and a lateness of some milliseconds beside a '
    'computation does not matter. Topics without a type carry up to 4 KB.',
    'Use another process for long native calls (large NumPy operations, JSON, images): no system '
    'here interrupts them within one interpreter (preemption, native call).',
    'Use C or C++ under PREEMPT_RT, or a microcontroller, below 10 us, or where a deadline has to '
    'be guaranteed and not only measured, such as for safety. The rows clock_nanosleep and '
    'cyclictest (wakeup) say what this machine gives to any program.')
WORDS = (
    'us: microsecond, a thousandth of a millisecond. A dash: not measured, not reported by that '
    'system, or too few samples to say it.',
    'p50, p99, p99.9: the value that 50, 99, 99.9 of 100 samples do not exceed; p50 is the '
    'median. max: the largest sample. In pictures of tails the vertical axis says which part of '
    'all samples is later than the value below.',
    'Latency, late: from when a call was due to its first line. Delay: from an event (a message, '
    'a byte) to the first line of the one that waits for it.',
    'Compiled, pure Python: the two builds of rt_robot_os, its hot path in C or as '
    'it is written.',
    'Range: the lowest and the highest of the repeats. All other figures are their medians.',
    'Task, module: what is called at its rate. Job: one call of a task. Release: the moment from '
    'which it may run. Core: the real-time process of rt_robot_os. Link: the socket from it to '
    'other processes. Mirror: to send what is published there to ROS 2.',
    'SCHED_FIFO: the priority of Linux that ordinary processes do not interrupt. Floor: a bare '
    'loop of clock_nanosleep, than which nothing in Python can be earlier.',
    'Paper 1: Design and implementation of real-time robot operating system based on FreeRTOS (a '
    'microcontroller, STM32F4). Paper 2: Real-time control architecture using Xenomai for '
    'intelligent service robots in USN environments. rt_robot_os does on Linux and in Python '
    'what they describe. Their figures are quoted in italics; nothing of them ran here.')


def requirements(results: Sequence[CaseResult]) -> Iterator[Block]:
    """Show which system is good enough for what, with the figures that say so."""
    known = [each for result in results for each in result.requirements if each.known]
    if not known:
        return
    yield Heading('Which system meets which requirement', 2)
    yield Paragraph(
        'Yes: what was measured here, as the median of the repeats, is at least as good as the '
        'requirement says; (?): the median says so, but not each of the repeats; a dash: that was '
        'not measured. Best rclpy: the best of its executors in that row. p99: 99 of 100 are at '
        'most that late. The case named has all figures. The advice below the table holds on any '
        'machine, its yes and no on this one.')
    systems = [name for name in SYSTEMS
               if any(each.systems.get(name) is not None for each in known)]
    yield TableBlock(('requirement', 'case', *systems, 'good enough'), [
        (each.text, each.case, *(fit(each, name) or '-' for name in systems), _use(each))
        for each in known], [''] * len(known), 2)
    yield Bullets(USE)


def _use(each: Requirement) -> str:
    known = [name for name in SYSTEMS if each.meets(name) is not None]
    fitting = [name + ('' if each.agrees(name) else ' (?)') for name in known if each.meets(name)]
    if len(fitting) == len(known) > 1 and all(each.agrees(name) for name in known):
        return 'all that were measured'
    return ', '.join(fitting) or 'none of these'
