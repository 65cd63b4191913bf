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

"""Replay of logs of decisions of MultiHopLQI nodes, which its rules must explain."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from collections.abc import Sequence
import copy
import csv
import gzip
from pathlib import Path
from typing import Final
from typing import NamedTuple
import zlib

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.wsn.packets.multihop_lqi import NO_PARENT
from rt_robot_os.features.wsn.packets.multihop_lqi import NO_ROUTE_COST
from rt_robot_os.features.wsn.packets.multihop_lqi import NO_ROUTE_HOPS
from rt_robot_os.features.wsn.routing.lqi_route import Decision
from rt_robot_os.features.wsn.routing.lqi_route import LqiRoute

#: Names of logs of decisions.
PATTERN: Final = '*decisions.csv*'

# Names of the branches in the log of TOSSIM.
_BRANCHES: Final = {Decision.RENEW: 'Not a loop', Decision.LOSE: 'Detected a loop',
                    Decision.CHANGE: 'Not a cycle', Decision.KEEP: 'CYCLE'}


# Branches in which the sender of the beacon becomes the parent.
_GIVES_PARENT: Final = (_BRANCHES[Decision.RENEW], _BRANCHES[Decision.CHANGE])
_RENEWED: Final = _BRANCHES[Decision.RENEW]

Row = Mapping[str, str]


class ReplayResult(NamedTuple):
    """
    Result of replaying a log.

    :ivar rows: number of compared rows.
    :ivar explained: number of compared rows that agree with the rules.
    :ivar first: number of the first compared row, from 1; 0: there was none.
    :ivar unknown: number of rows that were not compared: the log starts in mid-run, and the state
        of a node of the row does not follow from the rows above.
    """

    rows: int
    explained: int
    first: int
    unknown: int


class DecisionReplay:
    """
    Replay of a log of decisions, row by row.

    The state of a node follows from the row of its last beacon. In between it may have lost its
    route, by a packet that came back, for which the log has no row. The log has no parents of
    senders either; they follow from the state of the sender when it advertised the cost.

    :param mid_run: the log does not start with the nodes. Then the state of a node is unknown up
        to the first row that gives it a parent; such rows are not compared.
    :ivar explained: number of rows, by branch and by whether the route had been lost before.
    """

    def __init__(self, mid_run: bool = False) -> None:
        """Start without routes but that of the sink."""
        self.explained: Counter[tuple[str, bool]] = Counter()
        self._mid_run = mid_run
        self._routes: dict[int, LqiRoute] = {}
        self._advertised: dict[tuple[int, int], tuple[int, int]] = {(0, 0): (0, 0)}

    def explain(self, row: Row) -> bool | None:
        """
        Return whether the rules explain a row; None when the state is unknown.

        :raises KeyError: the row lacks a column.
        :raises ValueError: a number in it cannot be parsed.
        """
        node, sender, cost, lqi = (
            int(row[name]) for name in ('node', 'beacon_from', 'advertised_cost', 'lqi'))
        hops, link, parent_cost = after = tuple(int(row[name]) for name in (
            'hopcount_after', 'linkcost_after', 'parentcost_after'))
        sender_route = (NO_PARENT, NO_ROUTE_HOPS) if cost == NO_ROUTE_COST else (
            self._advertised.get((sender, cost)))
        if self._mid_run and (node not in self._routes or (
                sender_route is None and sender not in self._routes and sender)):
            self._adopt(row['branch'], node, sender, after)
            return None
        if sender_route is None:
            return False
        fresh = LqiRoute(node, u16_wrap=False)
        for lost, known in enumerate((self._routes.get(node, fresh), fresh)):
            route = copy.copy(known)
            branch = _BRANCHES[route.update(sender, sender_route[0], cost, sender_route[1], lqi)]
            if branch == row['branch'] and (
                    route.hops, route.link, route.parent_cost) == (hops, link, parent_cost):
                self._store(node, route)
                self.explained[branch, bool(lost)] += 1
                return True
        return False

    def _store(self, node: int, route: LqiRoute) -> None:
        self._routes[node] = route
        self._advertised[node, route.cost] = route.parent, route.hops

    def _adopt(self, branch: str, node: int, sender: int, after: tuple[int, ...]) -> None:
        """Adopt the state of a node from a row, if the row is complete."""
        route = LqiRoute(node, u16_wrap=False)
        if branch in _GIVES_PARENT:
            route.parent = sender
            route.hops, route.link, route.parent_cost = after
        elif (route.hops, route.link, route.parent_cost) != after:
            return  # the row does not have its parent
        self._store(node, route)


def starts_in_mid_run(rows: Sequence[Row]) -> bool:
    """
    Return whether a node has a route without a row that explains it.

    :raises KeyError: a row lacks a column.
    :raises ValueError: a number in it cannot be parsed.
    """
    seen = {0}
    for row in rows:
        node, sender = int(row['node']), int(row['beacon_from'])
        if (sender not in seen and int(row['advertised_cost']) != NO_ROUTE_COST) or (
                node not in seen and row['branch'] == _RENEWED):
            return True
        seen.add(node)
    return False


def replay_log(path: Path) -> ReplayResult:
    """
    Replay a log, gzipped (.gz) or not.

    :raises ConfigError: it cannot be read, or is not a log of decisions.
    """
    found: list[bool | None] = []
    try:
        with gzip.open(path, 'rt') if path.suffix == '.gz' else path.open() as file:
            rows = list(csv.DictReader(file))
        log = DecisionReplay(starts_in_mid_run(rows))
        for row in rows:
            found.append(log.explain(row))
    except (OSError, EOFError, zlib.error) as error:
        raise ConfigError([f'{path}: cannot be read: {error}']) from None
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise ConfigError([f'{path}: row {len(found) + 1} is not a row of decisions: '
                           f'{error!r}']) from None
    compared = [index for index, one in enumerate(found, 1) if one is not None]
    return ReplayResult(len(compared), sum(bool(one) for one in found),
                        compared[0] if compared else 0, len(found) - len(compared))
