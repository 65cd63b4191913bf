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

"""Times, distances and sentences of the agent, as settings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from rt_robot_os.base.schema import setting

LEAVES: Final = 'return'
GIVES_UP: Final = 'give_up'


@dataclass(frozen=True)
class AgentTuning:
    """Times, distances and sentences of the agent."""

    # ---- what it serves --------------------------------------------------------------------
    least_level: str = setting(
        'urgent', 'The robot ignores alarms below this level',
        choices=('warning', 'urgent', 'critical'))
    when_acknowledged: str = setting(
        'stay', 'What it does after an acknowledgement: stay until the alarm is resolved, or '
        'return', choices=('stay', LEAVES), live=True)
    after_operator: str = setting(
        'resume', 'What it does when an operator has stopped driving: resume, or give up',
        choices=('resume', GIVES_UP), live=True)
    operator_hold_s: float = setting(
        3.0, 'After this time without a command the operator has stopped driving', 's', 0.2,
        600.0, live=True)
    # ---- asking ----------------------------------------------------------------------------
    confirm_s: float = setting(
        25.0, 'How long it waits for an answer; shorter than confirm_s of the alarms, which '
        'raise the alarm otherwise', 's', 1.0, 600.0, live=True)
    ask_again_s: float = setting(
        8.0, 'Period at which it asks again', 's', 1.0, 60.0, live=True)
    quiet_s: float = setting(
        3.0, 'How long after its own speech the microphone is ignored', 's', 0.0, 30.0, live=True)
    voice_db: float = setting(
        -30.0, 'Sound above this level is treated as an answer that was not understood, in dB '
        'below full scale', 'dB', -120.0, 0.0, live=True)
    # ---- driving ---------------------------------------------------------------------------
    standoff_m: float = setting(
        1.0, 'Distance from a person at which it stands', 'm', 0.3, 5.0)
    spread_m: float = setting(
        0.2, 'Tolerance of that distance', 'm', 0.0, 1.0)
    follow_m: float = setting(
        0.5, 'How far a person has to move before it follows', 'm', 0.1, 10.0, live=True)
    near_m: float = setting(
        2.5, 'Distance from a person within which it drives slowly', 'm', 0.0, 20.0, live=True)
    near_m_s: float = setting(
        0.3, 'Speed limit within that distance', 'm/s', 0.02, 2.0, live=True)
    turn_rad_s: float = setting(
        0.8, 'The highest rate of turning in place', 'rad/s', 0.05, 5.0, live=True)
    turn_rad_s2: float = setting(
        1.5, 'The acceleration of turning in place', 'rad/s^2', 0.05, 20.0, live=True)
    aligned_rad: float = setting(
        0.1, 'Within this angle it faces a location', 'rad', 0.01, 1.0, live=True)
    camera_rad: float = setting(
        0.0, 'Direction of the camera, to the left from the front of the robot', 'rad',
        -3.2, 3.2)
    approach_s: float = setting(
        180.0, 'Time limit for driving to a person', 's', 5.0, 3600.0, live=True)
    place_s: float = setting(
        5.0, 'How long it waits for the location of an emergency to become known', 's', 0.0, 600.0,
        live=True)
    places: int = setting(
        4, 'Poses next to a person that it tries before it is blocked', '', 1, 16)
    answer_s: float = setting(
        5.0, 'Time-out of the planner after a goal', 's', 0.5, 60.0, live=True)
    waiting_s: float = setting(
        20.0, 'How long it waits for a free path before it tries another pose', 's',
        1.0, 600.0, live=True)
    pause_s: float = setting(
        1.0, 'Pause between two such goals', 's', 0.1, 60.0, live=True)
    lost_s: float = setting(
        5.0, 'How long the position may be unknown', 's', 0.5, 600.0, live=True)
    position_stddev_max_m: float = setting(
        0.5, 'A position with a larger standard deviation counts as unknown', 'm', 0.01,
        10.0, live=True)
    battery_low: float = setting(
        0.15, 'Charge of the battery below which it only drives home, from 0 to 1', '', 0.0,
        1.0, live=True)
    # ---- being there -----------------------------------------------------------------------
    look_s: float = setting(
        6.0, 'Time limit for turning to a person', 's', 0.5, 60.0, live=True)
    observe_s: float = setting(
        20.0, 'Time limit for pictures and sound', 's', 0.5, 600.0, live=True)
    report_s: float = setting(
        3.0, 'Duration of the report', 's', 0.1, 60.0, live=True)
    stay_s: float = setting(
        3600.0, 'How long it stays with a person', 's', 10.0, 86400.0, live=True)
    company_s: float = setting(
        120.0, 'How long it stays with a person when another emergency waits', 's',
        0.0, 86400.0, live=True)
    comfort_s: float = setting(
        60.0, 'Period at which it speaks meanwhile', 's', 5.0, 3600.0, live=True)
    # ---- failing ---------------------------------------------------------------------------
    retries: int = setting(
        2, 'Tries after it gave up', '', 0, 100, live=True)
    retry_s: float = setting(
        60.0, 'Pause before each of these tries', 's', 1.0, 3600.0, live=True)
    give_up_s: float = setting(
        120.0, 'How long it stands after it gave up finally', 's', 0.0, 86400.0, live=True)
    return_s: float = setting(
        300.0, 'Time limit for driving home', 's', 5.0, 3600.0, live=True)
    # ---- words -----------------------------------------------------------------------------
    question: str = setting(
        'Are you all right, {person}? Please answer, or press your button.',
        'The question; {person} stands for the name', live=True)
    unclear: str = setting(
        'I heard you, {person}, but I do not understand. Please press your button.',
        'What it says after an unclear answer', live=True)
    fine: str = setting(
        'Good. I am going back.', 'What it says when all is well', live=True)
    coming: str = setting(
        'I am coming, {person}.', 'What it says when it sets out', live=True)
    comfort: str = setting(
        'I am with you, {person}. Help has been called.', 'What it says next to the person',
        live=True)
    unreachable: str = setting(
        'I cannot get to you, {person}. Help has been called.', 'What it says when it gave up',
        live=True)
