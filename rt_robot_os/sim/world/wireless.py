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


"""The wireless nodes of the world: where each is now, whether it has power, who calls for help."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Sequence
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.messages.quantities import ALARMS
from rt_robot_os.messages.survey import SurveyedNode
from rt_robot_os.sim.world.events import FINE
from rt_robot_os.sim.world.events import WorldEvent
from rt_robot_os.sim.world.people import SimulatedPerson
from rt_robot_os.sim.world.vitals import SIGNS

ALARM: Final = 'alarm'
PRESS: Final = 'press'
#: What ends an alarm.
CALM: Final = 'calm'
#: How long a button stays pressed when nobody says.
PRESSED_S: Final = 10.0
# What the button of a node says.
_HELP_CODE: Final = 1
_FINE_CODE: Final = 2
# Happening -> the quantity of a node that it changes; an alarm all that there are.
_QUANTITIES: Final = {ALARM: ALARMS, PRESS: frozenset({ALARM}), 'smoke': frozenset({'smoke'}),
                      'water': frozenset({'water'})}


class WirelessNode:
    """
    A node as it is now; whoever simulates its radio follows what is written here.

    :ivar surveyed: as the settings have it.
    :ivar person: who wears it; None for one that hangs somewhere.
    :ivar on: it has power.
    :ivar boots: how often it was switched on, the first time included.
    :ivar alarms: what its button, its smoke or water sensor says; 0, which is nothing, is left
        out. Another object after each change.
    """

    def __init__(self, surveyed: SurveyedNode, person: SimulatedPerson | None) -> None:
        """Put it where the survey says, with power."""
        self.surveyed = surveyed
        self.name = surveyed.name
        self.person = person
        self.on = True
        self.boots = 1
        self.alarms: dict[str, int] = {}
        self._x, self._y, self._z = surveyed.x, surveyed.y, surveyed.z

    @property
    def position_m(self) -> tuple[float, float, float]:
        """Return where it is, in the frame of the map."""
        if self.person is not None:
            return self.person.x, self.person.y, self.person.worn_m(self._z)
        return self._x, self._y, self._z

    @property
    def worn(self) -> bool:
        """Return whether somebody wears it."""
        return self.person is not None

    def vital(self, sign: str) -> float | None:
        """Return a sign of who wears it, in its unit; None when nobody does, or of no sign."""
        person = self.person
        return person.vitals.value(sign, person.time_s) if person and sign in SIGNS else None

    def put(self, x: float, y: float) -> None:
        """Put it somewhere; nobody wears it any more."""
        self.person = None
        self._x, self._y = x, y

    def switch(self, on: bool) -> None:
        """Give it power, or take it."""
        if on and not self.on:
            self.boots += 1
        self.on = on

    def reboot(self) -> None:
        """Have it begin anew; one without power stays so."""
        self.boots += self.on

    def tell(self, quantities: Iterable[str], code: int) -> None:
        """Have its button or its sensors say something; 0 is nothing."""
        changed = {each: code for each in quantities if each in self.surveyed.quantities}
        self.alarms = {each: told for each, told in {**self.alarms, **changed}.items() if told}


class Wireless:
    """
    All wireless nodes of a world.

    :ivar nodes: in the order of the survey.
    """

    def __init__(self, surveyed: Iterable[SurveyedNode],
                 people: Sequence[SimulatedPerson]) -> None:
        """
        Place them; without any people what is to be worn lies where it was surveyed.

        :raises ConfigError: somebody is to wear one and is not among the people.
        """
        known = {person.name: person for person in people}
        problems = []
        nodes = []
        for each in surveyed:
            if each.person and known and each.person not in known:
                problems.append(f'world.nodes: {each.name}: there is no person {each.person} to '
                                f'wear it; there are {", ".join(known)}')
            nodes.append(WirelessNode(each, known.get(each.person)))
        if problems:
            raise ConfigError(problems)
        self.nodes = tuple(nodes)

    def problem(self, what: WorldEvent) -> str | None:
        """Return what keeps something from happening to a node."""
        if what.kind in _QUANTITIES:
            if next(self._alarmed(what.name, what.kind), None) is None:
                thing = 'button' if what.kind in (ALARM, PRESS) else 'sensor'
                return (f'{what.name} has no {thing}: no node of that name or of that person '
                        f'measures {", ".join(sorted(_QUANTITIES[what.kind]))}')
        elif self.named(what.name) is None:
            shown = ', '.join(each.name for each in self.nodes[:50]) or 'none'
            return f'there is no such node; there are {shown}'
        return None

    def named(self, name: str) -> WirelessNode | None:
        """Return the node of a name."""
        return next((each for each in self.nodes if each.name == name), None)

    def apply(self, what: WorldEvent) -> WorldEvent | None:
        """
        Have something happen to a node.

        :return: what ends it, after its time; None when nothing does.
        """
        if what.kind in _QUANTITIES:
            code = _FINE_CODE if what.word == FINE else _HELP_CODE
            for each in self._alarmed(what.name, what.kind):
                each.tell(_QUANTITIES[what.kind], code)
                if each.person is not None and code == _HELP_CODE:
                    each.person.vitals.frighten(each.person.time_s)
            # Smoke and water stay until somebody says.
            for_s = PRESSED_S if what.kind in (ALARM, PRESS) else 0.0
            return WorldEvent(CALM, what.name, (), for_s=for_s, word=what.kind)
        if what.kind == CALM:
            for each in self._alarmed(what.name, what.word):
                each.tell(_QUANTITIES[what.word], 0)
            return None
        node = self.named(what.name)
        assert node is not None
        if what.kind == 'node move':
            node.put(*what.numbers)
        elif what.kind == 'node reboot':
            node.reboot()
        else:
            node.switch(what.kind == 'node on')
        return WorldEvent('node on', what.name, ()) if what.kind == 'node off' else None

    def where(self) -> list[str]:
        """Return a line for each: ``node NAME x y height on|off``, in m."""
        return [' '.join(['node', each.name, *(f'{number:.3f}' for number in each.position_m),
                          'on' if each.on else 'off']) for each in self.nodes]

    def _alarmed(self, name: str, kind: str) -> Iterator[WirelessNode]:
        """Yield the nodes that something can happen to, by their name or that of their wearer."""
        for each in self.nodes:
            if _QUANTITIES[kind].intersection(each.surveyed.quantities) and name in (
                    each.name, each.person.name if each.person is not None else ''):
                yield each
