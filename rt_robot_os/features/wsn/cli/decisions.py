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

"""Logs of what nodes under MultiHopLQI decided on each beacon, explained by its rules."""

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

#: Such files of a folder are logs of decisions.
PATTERN: Final = '*decisions.csv*'

# As the log of TOSSIM names the branches.
_BRANCHES: Final = {Decision.RENEW: 'Not a loop', Decision.LOSE: 'Detected a loop',
                    Decision.CHANGE: 'Not a cycle', Decision.KEEP: 'CYCLE'}


# These give a node a parent, which is then the sender of the beacon.
_GIVES_PARENT: Final = (_BRANCHES[Decision.RENEW], _BRANCHES[Decision.CHANGE])
_RENEWED: Final = _BRANCHES[Decision.RENEW]

Row = Mapping[str, str]


class Explained(NamedTuple):
    """
    What the rules made of a log.

    :ivar rows: that were compared.
    :ivar explained: of these, rows that the rules give.
    :ivar first: number of the first row that was compared, from 1; 0: there was none.
    :ivar unknown: rows that were not compared: the log begins in mid-run, and what a node of the
        row knew before does not follow from the rows above it.
    """

    rows: int
    explained: int
    first: int
    unknown: int


class Decisions:
    """
    A log of what nodes decided, explained row by row.

    A node's state is carried from the row where it heard its last beacon to the next. Between the
    two it may have lost its route, to a packet that came back: the log has no row for that. What
    the sender named as its parent is not in the log either; it is what the sender itself had when
    it advertised such a cost.

    :param mid_run: the log does not begin when the nodes start. Then the state of a node is
        unknown up to the first row that gives it a parent; such rows are not compared.
    :ivar explained: how many rows, by branch and by whether the route had been lost before.
    """

    def __init__(self, mid_run: bool = False) -> None:
        """Begin with nodes that know nothing, and the sink."""
        self.explained: Counter[tuple[str, bool]] = Counter()
        self._mid_run = mid_run
        self._routes: dict[int, LqiRoute] = {}
        self._advertised: dict[tuple[int, int], tuple[int, int]] = {(0, 0): (0, 0)}

    def explain(self, row: Row) -> bool | None:
        """
        Tell whether the rules give what the row says; None where that cannot be known.

        :raises KeyError: the row lacks a column.
        :raises ValueError: a number in it is none.
        """
        node, sender, cost, lqi = (
            int(row[name]) for name in ('node', 'beacon_from', 'advertised_cost', 'lqi'))
        hops, link, parent_cost = after = tuple(int(row[name]) for name in (
            'hopcount_after', 'linkcost_after', 'parentcost_after'))
        told = (NO_PARENT, NO_ROUTE_HOPS) if cost == NO_ROUTE_COST else self._advertised.get(
            (sender, cost))
        if self._mid_run and (node not in self._routes or (
                told is None and sender not in self._routes and sender)):
            self._adopt(row['branch'], node, sender, after)
            return None
        if told is None:
            return False
        fresh = LqiRoute(node, u16_wrap=False)
        for lost, known in enumerate((self._routes.get(node, fresh), fresh)):
            route = copy.copy(known)
            branch = _BRANCHES[route.heard(sender, told[0], cost, told[1], lqi)]
            if branch == row['branch'] and (
                    route.hops, route.link, route.parent_cost) == (hops, link, parent_cost):
                self._know(node, route)
                self.explained[branch, bool(lost)] += 1
                return True
        return False

    def _know(self, node: int, route: LqiRoute) -> None:
        self._routes[node] = route
        self._advertised[node, route.cost] = route.parent, route.hops

    def _adopt(self, branch: str, node: int, sender: int, after: tuple[int, ...]) -> None:
        """Believe what a row says of a node, where it says all."""
        route = LqiRoute(node, u16_wrap=False)
        if branch in _GIVES_PARENT:
            route.parent = sender
            route.hops, route.link, route.parent_cost = after
        elif (route.hops, route.link, route.parent_cost) != after:
            return  # it has a parent, and the row does not say which
        self._know(node, route)


def begins_in_mid_run(rows: Sequence[Row]) -> bool:
    """
    Tell whether a node has a route that no row of the log gave it.

    :raises KeyError: a row lacks a column.
    :raises ValueError: a number in it is none.
    """
    seen = {0}
    for row in rows:
        node, sender = int(row['node']), int(row['beacon_from'])
        if (sender not in seen and int(row['advertised_cost']) != NO_ROUTE_COST) or (
                node not in seen and row['branch'] == _RENEWED):
            return True
        seen.add(node)
    return False


def explained(path: Path) -> Explained:
    """
    Replay a log, packed (.gz) or not.

    :raises ConfigError: it cannot be read, or is no such log.
    """
    found: list[bool | None] = []
    try:
        with gzip.open(path, 'rt') if path.suffix == '.gz' else path.open() as file:
            rows = list(csv.DictReader(file))
        log = Decisions(begins_in_mid_run(rows))
        for row in rows:
            found.append(log.explain(row))
    except (OSError, EOFError, zlib.error) as error:
        raise ConfigError([f'{path}: cannot be read: {error}']) from None
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise ConfigError([f'{path}: row {len(found) + 1} is not of a log of decisions: '
                           f'{error!r}']) from None
    compared = [index for index, one in enumerate(found, 1) if one is not None]
    return Explained(len(compared), sum(bool(one) for one in found),
                     compared[0] if compared else 0, len(found) - len(compared))
