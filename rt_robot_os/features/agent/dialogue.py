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

"""Ask a person whether they are well, and parse the answer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.agent.inputs import Say
from rt_robot_os.features.agent.tuning import AgentTuning

FINE: Final = 'fine'
HELP: Final = 'help'
#: Values of the button of a worn node, the quantity ``alarm``.
BUTTON: Final = {1: HELP, 2: FINE}


def answer_of(text: str) -> tuple[str, str] | None:
    """
    Parse an answer: ``anna fine``, ``anna help``, or one of the two words alone.

    :return: the person, empty without, and the word; None for anything else.
    """
    words = text.split()
    if not 1 <= len(words) <= 2 or words[-1].lower() not in (FINE, HELP):
        return None
    return (words[0] if len(words) == 2 else ''), words[-1].lower()


class Dialogue:
    """
    A repeated question, and whether the microphone has picked up a voice.

    :param say: receives what is to be said.
    :ivar voices: how often a voice was detected that is not an answer.
    """

    def __init__(self, tuning: AgentTuning, say: Callable[[Say], None]) -> None:
        self.tuning = tuning
        self.voices = 0
        self._say = say
        self._person = ''
        self._is_unclear = False
        self._asked_ns = self._again_ns = self._quiet_ns = -1

    def begin(self, person: str, t_ns: int) -> None:
        """Ask for the first time."""
        self._person, self.voices, self._asked_ns = person, 0, t_ns
        self._is_unclear = False
        self.speak(self.tuning.question, t_ns)

    def speak(self, text: str, t_ns: int, person: str = '') -> None:
        """Say something; for a while the microphone is ignored."""
        t = self.tuning
        self._again_ns = t_ns + round(t.ask_again_s * NS_PER_S)
        self._quiet_ns = t_ns + round(t.quiet_s * NS_PER_S)
        if text:
            self._say(Say(text.replace('{person}', person or self._person)))

    def tick(self, voice_db: float, t_ns: int) -> None:
        """
        Ask again when it is due, and immediately after a voice; NaN is no sound.

        Continuous noise is answered no more often than the question is asked.
        """
        if t_ns >= self._quiet_ns and voice_db >= self.tuning.voice_db:
            self.voices += 1
            if not self._is_unclear or t_ns >= self._again_ns:
                self._is_unclear = True
                self.speak(self.tuning.unclear, t_ns)
        elif t_ns >= self._again_ns:
            self._is_unclear = False
            self.speak(self.tuning.question, t_ns)

    def counts(self, stamp_ns: int) -> bool:
        """Return whether an answer of that time is one to this question."""
        return 0 <= self._asked_ns <= stamp_ns
