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


"""The wireless nodes of the world: position, power and alarms of each."""

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
#: The event that ends an alarm.
CALM: Final = 'calm'
#: Default duration of a pressed button.
PRESSED_S: Final = 10.0
# Codes of the button of a node.
_HELP_CODE: Final = 1
_FINE_CODE: Final = 2
# Event -> the quantity of a node that it changes; an alarm changes all.
_QUANTITIES: Final = {ALARM: ALARMS, PRESS: frozenset({ALARM}), 'smoke': frozenset({'smoke'}),
                      'water': frozenset({'water'})}


class WirelessNode:
    """
    The current state of a node; the simulation of its radio reads it.

    :ivar surveyed: its entry in the settings.
    :ivar person: its wearer; None for a fixed node.
    :ivar on: it has power.
    :ivar boots: how often it was switched on, including the first time.
    :ivar alarms: the codes of its button, smoke or water sensor; 0 (none) is left out. A new
        object after each change.
    """

    def __init__(self, surveyed: SurveyedNode, person: SimulatedPerson | None) -> None:
        """Put it at its surveyed position, with power."""
        self.surveyed = surveyed
        self.name = surveyed.name
        self.person = person
        self.on = True
        self.boots = 1
        self.alarms: dict[str, int] = {}
        self._x, self._y, self._z = surveyed.x, surveyed.y, surveyed.z

    @property
    def position_m(self) -> tuple[float, float, float]:
        """Return its position in the frame of the map."""
        if self.person is not None:
            return self.person.x, self.person.y, self.person.worn_m(self._z)
        return self._x, self._y, self._z

    @property
    def worn(self) -> bool:
        """Return whether a person wears it."""
        return self.person is not None

    def vital(self, sign: str) -> float | None:
        """Return a vital sign of its wearer, in its unit; None without a wearer or such a sign."""
        person = self.person
        return person.vitals.value(sign, person.time_s) if person and sign in SIGNS else None

    def move_to(self, x: float, y: float) -> None:
        """Move it to a fixed position; it is not worn any more."""
        self.person = None
        self._x, self._y = x, y

    def set_power(self, on: bool) -> None:
        """Switch its power on or off."""
        if on and not self.on:
            self.boots += 1
        self.on = on

    def reboot(self) -> None:
        """Reboot it; a node without power stays off."""
        self.boots += self.on

    def set_alarms(self, quantities: Iterable[str], code: int) -> None:
        """Set the code of its button or its sensors; 0 for none."""
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
        Place them; without any people a node for a wearer is fixed at its surveyed position.

        :raises ConfigError: a wearer is not among the people.
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
        """Return why an event cannot apply to a node."""
        if what.kind in _QUANTITIES:
            if next(self._alarmed(what.name, what.kind), None) is None:
                thing = 'button' if what.kind in (ALARM, PRESS) else 'sensor'
                return (f'{what.name} has no {thing}: no node of that name or of that person '
                        f'measures {", ".join(sorted(_QUANTITIES[what.kind]))}')
        elif self.find(what.name) is None:
            shown = ', '.join(each.name for each in self.nodes[:50]) or 'none'
            return f'there is no such node; there are {shown}'
        return None

    def find(self, name: str) -> WirelessNode | None:
        """Return the node of a name."""
        return next((each for each in self.nodes if each.name == name), None)

    def apply(self, what: WorldEvent) -> WorldEvent | None:
        """
        Apply an event to a node.

        :return: the event that ends it, after its duration; None if there is none.
        :raises KeyError: the name is unknown; :meth:`problem` reports that before.
        """
        if what.kind in _QUANTITIES:
            code = _FINE_CODE if what.word == FINE else _HELP_CODE
            for each in self._alarmed(what.name, what.kind):
                each.set_alarms(_QUANTITIES[what.kind], code)
                if each.person is not None and code == _HELP_CODE:
                    each.person.vitals.frighten(each.person.time_s)
            # Smoke and water remain until they are cleared.
            for_s = PRESSED_S if what.kind in (ALARM, PRESS) else 0.0
            return WorldEvent(CALM, what.name, (), for_s=for_s, word=what.kind)
        if what.kind == CALM:
            for each in self._alarmed(what.name, what.word):
                each.set_alarms(_QUANTITIES[what.word], 0)
            return None
        node = self.find(what.name)
        if node is None:
            raise KeyError(what.name)
        if what.kind == 'node move':
            node.move_to(*what.numbers)
        elif what.kind == 'node reboot':
            node.reboot()
        else:
            node.set_power(what.kind == 'node on')
        return WorldEvent('node on', what.name, ()) if what.kind == 'node off' else None

    def where(self) -> list[str]:
        """Return a line for each: ``node NAME x y height on|off``, in m."""
        return [' '.join(['node', each.name, *(f'{number:.3f}' for number in each.position_m),
                          'on' if each.on else 'off']) for each in self.nodes]

    def _alarmed(self, name: str, kind: str) -> Iterator[WirelessNode]:
        """Yield the nodes that an event applies to, by their name or that of their wearer."""
        for each in self.nodes:
            if _QUANTITIES[kind].intersection(each.surveyed.quantities) and name in (
                    each.name, each.person.name if each.person is not None else ''):
                yield each
