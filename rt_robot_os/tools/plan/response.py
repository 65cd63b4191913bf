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
Longest response times under fixed priorities, with equals in the order of their release.

Sources: M. Joseph and P. Pandya 1986 (the recurrence), N. Audsley et al. 1993 (blocking, release
jitter), J. Lehoczky 1990 (deadlines beyond the period: every job of the busy period), K. Tindell
and J. Clark 1994 (chains: the jitter of what is released is the response of the releaser),
S. Martin, P. Minet and L. George 2005 (fixed priorities with first in, first out among equals).

A job of priority p that is released ``t`` after the beginning of a busy period has ended when
these are done, and no sooner is needed for the bound to hold:

- what blocks: one stretch of one task below p, begun just before;
- every job of priority p released up to ``t``, its own included. That an equal which has started
  is not preempted adds nothing: it was released earlier and comes first anyway;
- every job above p released until that end;
- a tick for every release by a timer until that end, also of tasks below.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence

ROUNDS_MAXIMUM = 20_000
CANDIDATES_MAXIMUM = 20_000

# (period, jitter, cost), all in nanoseconds
Load = tuple[int, int, int]


class NoBoundError(Exception):
    """No bound was found; the text completes "task x: ..."."""


def _demand_ns(window_ns: int, loads: Sequence[Load]) -> int:
    """Sum what may be released in a window, its end excluded."""
    total_ns = 0
    for period, jitter, cost in loads:  # not sum(): here the time of a whole plan goes
        total_ns -= -(window_ns + jitter) // period * cost
    return total_ns


def merged(loads: Iterable[Load]) -> list[Load]:
    """Join what is released together, always: the demand is the same, and found sooner."""
    costs: dict[tuple[int, int], int] = {}
    for period, jitter, cost in loads:
        costs[period, jitter] = costs.get((period, jitter), 0) + cost
    return [(period, jitter, cost) for (period, jitter), cost in costs.items()]


def _fixed_point(start_ns: int, base_ns: int, loads: Sequence[Load]) -> int:
    window_ns = start_ns
    for _ in range(ROUNDS_MAXIMUM):
        longer_ns = base_ns + _demand_ns(window_ns, loads)
        if longer_ns <= window_ns:
            return window_ns
        window_ns = longer_ns
    raise NoBoundError(f'no bound was found within {window_ns / 1e9:.3g} s: the load is too near '
                       'to 100 %')


def busy_period_ns(blocking_ns: int, loads: Sequence[Load]) -> int:
    """
    Return the longest time without a moment at which all that was released is done.

    :param loads: everything of a priority and above; together below 100 %.
    :raises NoBoundError: it does not end in reasonable time.
    """
    start_ns = blocking_ns + sum(cost for _, _, cost in loads)
    return _fixed_point(start_ns, blocking_ns, loads)


def _moments(end_ns: int, own: Load, equal: Sequence[Load]) -> list[int]:
    """List the moments of release that can be worst: where equal work steps up."""
    found = {0}
    steps = [(own[0], 0), *((period, jitter % period) for period, jitter, _ in equal)]
    if sum(end_ns // period + 1 for period, _ in steps) > CANDIDATES_MAXIMUM:
        raise NoBoundError(f'no bound was found: its busy period of {end_ns / 1e9:.3g} s holds '
                           f'more than {CANDIDATES_MAXIMUM} jobs of its priority')
    for period, jitter in steps:
        found.update(range(-jitter % period, end_ns, period))
    return sorted(found)


def response_ns(blocking_ns: int, own: Load, equal: Sequence[Load], higher: Sequence[Load],
                busy_ns: int) -> int:
    """
    Bound the time from the regular release of a job, before its jitter, to its end.

    :param own: of the stream of releases that the job belongs to.
    :param equal: the other streams of this priority.
    :param higher: everything that preempts.
    :param busy_ns: from :func:`busy_period_ns` for all of these.
    :raises NoBoundError: there are too many jobs to analyse.
    """
    period, jitter, cost = own
    worst_ns = end_ns = 0
    for moment in _moments(busy_ns, own, equal):
        work_ns = blocking_ns + (1 + moment // period) * cost + sum(
            (1 + (moment + j) // t) * c for t, j, c in equal)
        end_ns = _fixed_point(max(end_ns, work_ns), work_ns, higher)
        worst_ns = max(worst_ns, end_ns - moment)
    return worst_ns + jitter


def response_from_arrival_ns(blocking_ns: int, own: Load, equal: Sequence[Load],
                             higher: Sequence[Load], busy_ns: int) -> int:
    """Bound the time from the moment at which a job became ready, after its jitter, to its end."""
    period, jitter, cost = own
    # The job's own stream is then like any equal one: in a burst those before it came with it.
    late = (period, jitter, cost)
    worst_ns = end_ns = 0
    for moment in _moments(busy_ns, (period, 0, cost), [late, *equal]):
        work_ns = blocking_ns + sum(
            (1 + (moment + j) // t) * c for t, j, c in (late, *equal))
        end_ns = _fixed_point(max(end_ns, work_ns), work_ns, higher)
        worst_ns = max(worst_ns, end_ns - moment)
    return worst_ns
