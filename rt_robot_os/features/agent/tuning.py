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

"""How long the agent waits, how near it goes and what it says, as settings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from rt_robot_os.base.schema import setting

LEAVES: Final = 'return'
GIVES_UP: Final = 'give_up'


@dataclass(frozen=True)
class AgentTuning:
    """How long the agent waits, how near it goes and what it says."""

    # ---- what it serves --------------------------------------------------------------------
    least_level: str = setting(
        'urgent', 'Alarms below this level are left to people',
        choices=('warning', 'urgent', 'critical'))
    when_acknowledged: str = setting(
        'stay', 'What it does when somebody has acknowledged: stay until the alarm is resolved, '
        'or return', choices=('stay', LEAVES), live=True)
    after_operator: str = setting(
        'resume', 'What it does when an operator has let go: resume what it did, or give up',
        choices=('resume', GIVES_UP), live=True)
    operator_hold_s: float = setting(
        3.0, 'An operator who has not steered for so long has let go', 's', 0.2, 600.0, live=True)
    # ---- asking ----------------------------------------------------------------------------
    confirm_s: float = setting(
        25.0, 'How long it waits for an answer; less than the alarms wait, or they do not wait '
        'for it', 's', 1.0, 600.0, live=True)
    ask_again_s: float = setting(
        8.0, 'How long after a question it asks again', 's', 1.0, 60.0, live=True)
    quiet_s: float = setting(
        3.0, 'How long after it has spoken the microphone counts for nothing: it would hear '
        'itself', 's', 0.0, 30.0, live=True)
    voice_db: float = setting(
        -30.0, 'Sound above this level is taken for an answer that nobody understood, in dB below '
        'full scale', 'dB', -120.0, 0.0, live=True)
    # ---- driving ---------------------------------------------------------------------------
    standoff_m: float = setting(
        1.0, 'How far from somebody it stands', 'm', 0.3, 5.0)
    spread_m: float = setting(
        0.2, 'How much nearer or farther that may be', 'm', 0.0, 1.0)
    follow_m: float = setting(
        0.5, 'How far somebody has to have moved for it to follow', 'm', 0.1, 10.0, live=True)
    near_m: float = setting(
        2.5, 'Nearer to somebody than this it drives slowly', 'm', 0.0, 20.0, live=True)
    near_m_s: float = setting(
        0.3, 'How fast that is at most', 'm/s', 0.02, 2.0, live=True)
    turn_rad_s: float = setting(
        0.8, 'How fast it turns in place at most', 'rad/s', 0.05, 5.0, live=True)
    turn_rad_s2: float = setting(
        1.5, 'How fast that rate changes', 'rad/s^2', 0.05, 20.0, live=True)
    aligned_rad: float = setting(
        0.1, 'It looks at something when it is off by less', 'rad', 0.01, 1.0, live=True)
    camera_rad: float = setting(
        0.0, 'Where the camera looks, counted to the left from the front of the robot', 'rad',
        -3.2, 3.2)
    approach_s: float = setting(
        180.0, 'How long it tries to get to somebody', 's', 5.0, 3600.0, live=True)
    place_s: float = setting(
        5.0, 'How long it waits for the place of an emergency to become known', 's', 0.0, 600.0,
        live=True)
    places: int = setting(
        4, 'How many places beside somebody it tries before it is blocked', '', 1, 16)
    answer_s: float = setting(
        5.0, 'Silence of the planner after a goal that is trouble', 's', 0.5, 60.0, live=True)
    waiting_s: float = setting(
        20.0, 'How long it waits for a way to become free before it tries another place', 's',
        1.0, 600.0, live=True)
    pause_s: float = setting(
        1.0, 'How long it pauses between two such goals', 's', 0.1, 60.0, live=True)
    lost_s: float = setting(
        5.0, 'How long the position may be unknown', 's', 0.5, 600.0, live=True)
    position_stddev_max_m: float = setting(
        0.5, 'A position that is known worse counts as unknown', 'm', 0.01, 10.0, live=True)
    battery_low: float = setting(
        0.15, 'Charge of the battery below which it goes nowhere but home, from 0 to 1', '', 0.0,
        1.0, live=True)
    # ---- being there -----------------------------------------------------------------------
    look_s: float = setting(
        6.0, 'How long it may take to look at somebody', 's', 0.5, 60.0, live=True)
    observe_s: float = setting(
        20.0, 'How long it waits for pictures and sound', 's', 0.5, 600.0, live=True)
    report_s: float = setting(
        3.0, 'How long it takes to tell what it found', 's', 0.1, 60.0, live=True)
    stay_s: float = setting(
        3600.0, 'How long it stays', 's', 10.0, 86400.0, live=True)
    company_s: float = setting(
        120.0, 'How long it stays when another emergency waits', 's', 0.0, 86400.0, live=True)
    comfort_s: float = setting(
        60.0, 'How often it speaks meanwhile', 's', 5.0, 3600.0, live=True)
    # ---- failing ---------------------------------------------------------------------------
    retries: int = setting(
        2, 'How often it tries again after it gave up', '', 0, 100, live=True)
    retry_s: float = setting(
        60.0, 'How long it waits before', 's', 1.0, 3600.0, live=True)
    give_up_s: float = setting(
        120.0, 'How long it stands where it gave up for good', 's', 0.0, 86400.0, live=True)
    return_s: float = setting(
        300.0, 'How long the way home may take', 's', 5.0, 3600.0, live=True)
    # ---- words -----------------------------------------------------------------------------
    question: str = setting(
        'Are you all right, {person}? Please answer, or press your button.',
        'What it asks; {person} stands for the name', live=True)
    unclear: str = setting(
        'I heard you, {person}, but I do not understand. Please press your button.',
        'What it says when it heard something', live=True)
    fine: str = setting(
        'Good. I am going back.', 'What it says when all is well', live=True)
    coming: str = setting(
        'I am coming, {person}.', 'What it says when it sets out', live=True)
    comfort: str = setting(
        'I am with you, {person}. Help has been called.', 'What it says when it is there',
        live=True)
    unreachable: str = setting(
        'I cannot get to you, {person}. Help has been called.', 'What it says when it gave up',
        live=True)
