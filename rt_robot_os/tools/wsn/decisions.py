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
import copy
import csv
import gzip
from pathlib import Path
from typing import Final

from rt_robot_os.errors import ConfigError
from rt_robot_os.wsn.packets.multihop_lqi import NO_PARENT
from rt_robot_os.wsn.packets.multihop_lqi import NO_ROUTE_COST
from rt_robot_os.wsn.packets.multihop_lqi import NO_ROUTE_HOPS
from rt_robot_os.wsn.routing.lqi_route import Decision
from rt_robot_os.wsn.routing.lqi_route import LqiRoute

#: Such files of a folder are logs of decisions.
PATTERN: Final = '*decisions.csv*'

# As the log of TOSSIM names the branches.
_BRANCHES: Final = {Decision.RENEW: 'Not a loop', Decision.LOSE: 'Detected a loop',
                    Decision.CHANGE: 'Not a cycle', Decision.KEEP: 'CYCLE'}


class Decisions:
    """
    A log of what nodes decided, explained row by row.

    A node's state is carried from the row where it heard its last beacon to the next. Between the
    two it may have lost its route, to a packet that came back: the log has no row for that. What
    the sender named as its parent is not in the log either; it is what the sender itself had when
    it advertised such a cost.

    :ivar explained: how many rows, by branch and by whether the route had been lost before.
    """

    def __init__(self) -> None:
        """Begin with nodes that know nothing, and the sink."""
        self.explained: Counter[tuple[str, bool]] = Counter()
        self._routes: dict[int, LqiRoute] = {}
        self._advertised: dict[tuple[int, int], tuple[int, int]] = {(0, 0): (0, 0)}

    def explain(self, row: Mapping[str, str]) -> bool:
        """
        Tell whether the rules give what the row says.

        :raises KeyError: the row lacks a column.
        :raises ValueError: a number in it is none.
        """
        node, sender, cost, lqi = (
            int(row[name]) for name in ('node', 'beacon_from', 'advertised_cost', 'lqi'))
        after = tuple(int(row[name]) for name in (
            'hopcount_after', 'linkcost_after', 'parentcost_after'))
        told = (NO_PARENT, NO_ROUTE_HOPS) if cost == NO_ROUTE_COST else self._advertised.get(
            (sender, cost))
        if told is None:
            return False
        fresh = LqiRoute(node, u16_wrap=False)
        for lost, known in enumerate((self._routes.get(node, fresh), fresh)):
            route = copy.copy(known)
            branch = _BRANCHES[route.heard(sender, told[0], cost, told[1], lqi)]
            if branch == row['branch'] and (
                    route.hops, route.link, route.parent_cost) == after:
                self._routes[node] = route
                self._advertised[node, route.cost] = route.parent, route.hops
                self.explained[branch, bool(lost)] += 1
                return True
        return False


def explained(path: Path) -> tuple[int, int]:
    """
    Replay a log, packed (.gz) or not.

    :return: the rows that the rules explain, and all rows.
    :raises ConfigError: it cannot be read, or is no such log.
    """
    log = Decisions()
    found = []
    try:
        with gzip.open(path, 'rt') if path.suffix == '.gz' else path.open() as file:
            for row in csv.DictReader(file):
                found.append(log.explain(row))
    except OSError as error:
        raise ConfigError([f'{path}: cannot be read: {error}']) from None
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise ConfigError([f'{path}: row {len(found) + 1} is not of a log of decisions: '
                           f'{error!r}']) from None
    return sum(found), len(found)
