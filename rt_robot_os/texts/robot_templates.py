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

"""Texts of a robot that people read: their codes, and how they are written in English."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

TEMPLATES: Final = MappingProxyType({
    'fall': (
        '{person:w} has fallen: an impact of {peak:n} g, then turned by {turned:n} degrees and '
        'lying (confidence {confidence:n}, {grade:w})'),
    'fall_descent': (
        '{person:w} has fallen: an impact of {peak:n} g after a descent of {descent:n} m/s, '
        'then turned by {turned:n} degrees and lying (confidence {confidence:n}, {grade:w})'),
    'fall_peak': (
        '{person:w} was struck with {peak:n} g and has not moved for {seconds:n} s: perhaps a '
        'fall (confidence {confidence:n}, low: the node reports peaks only)'),
    'got_up': '{person:w} has got up and moves',
    'moves_again': '{person:w} moves again',
    'is_back': '{person:w} is back',
    'is_elsewhere': '{person:w} is elsewhere',
    'not_moved_s': '{person:w} has not moved for {length:n} s',
    'not_moved_in_s': '{person:w} has not moved for {length:n} s, {room:w}',
    'been_in_s': '{person:w} has been in {room:w} for {length:n} s',
    'away_s': '{person:w} has been away for {length:n} s',
    'not_moved_min': '{person:w} has not moved for {length:n} min',
    'not_moved_in_min': '{person:w} has not moved for {length:n} min, {room:w}',
    'been_in_min': '{person:w} has been in {room:w} for {length:n} min',
    'away_min': '{person:w} has been away for {length:n} min',
    'not_moved_h': '{person:w} has not moved for {length:n} h',
    'not_moved_in_h': '{person:w} has not moved for {length:n} h, {room:w}',
    'been_in_h': '{person:w} has been in {room:w} for {length:n} h',
    'away_h': '{person:w} has been away for {length:n} h',
    'no_signs': 'no vital signs of {person:w} arrive',
    'signs_again': 'vital signs of {person:w} arrive again',
    'is_alert': '{person:w} is alert',
    'is_confused': '{person:w} is newly confused',
    'reacts_voice': '{person:w} reacts only to a voice',
    'reacts_pain': '{person:w} reacts only to pain',
    'reacts_not': '{person:w} does not react',
    'limit': '{person:w}: {sign:sign} {value:n} {unit:w}, limit {limit:n}',
    'limit_bare': '{person:w}: {sign:sign} {value:n}, limit {limit:n}',
    'trend': '{person:w}: {sign:sign} {value:n} {unit:w}, {change:n} within {minutes:n} min',
    'news2': '{person:w}: NEWS2 {score:n}',
    'news2_missing': '{person:w}: NEWS2 {score:n}; missing: {missing:l}',
    'news2_missing_before': (
        '{person:w}: NEWS2 {score:n}; missing: {missing:l}; before that: {before:l}'),
    'news2_points': '{person:w}: NEWS2 {score:n} ({points:l})',
    'news2_points_missing': '{person:w}: NEWS2 {score:n} ({points:l}); missing: {missing:l}',
    'news2_points_missing_before': (
        '{person:w}: NEWS2 {score:n} ({points:l}); missing: {missing:l}; before that: '
        '{before:l}'),
    'news2_least': '{person:w}: NEWS2 at least {score:n}',
    'news2_least_missing': '{person:w}: NEWS2 at least {score:n}; missing: {missing:l}',
    'news2_least_missing_before': (
        '{person:w}: NEWS2 at least {score:n}; missing: {missing:l}; before that: {before:l}'),
    'news2_least_points': '{person:w}: NEWS2 at least {score:n} ({points:l})',
    'news2_least_points_missing': (
        '{person:w}: NEWS2 at least {score:n} ({points:l}); missing: {missing:l}'),
    'news2_least_points_missing_before': (
        '{person:w}: NEWS2 at least {score:n} ({points:l}); missing: {missing:l}; before that: '
        '{before:l}'),
    'points': '{sign:sign} {n:n}',
    'sign': '{sign:sign}',
    'sign_off': '{sign:sign} off',
    'sign_implausible': '{sign:sign} implausible',
    'sign_silent': '{sign:sign} silent',
    'measures_again': '{node:w} of {person:w} measures again',
    'measures_nothing': '{node:w} of {person:w} measures nothing: {what:l}',
    'contradict': '{sign:sign} of {person:w}: {sensors} contradict each other',
    'sink_silent': 'No packet of the sensor network comes any more: look at the sink',
    'node_battery': 'The battery of node {node:w} is nearly empty: {volts:n} V',
    'well_again': '{node} is well again',
    'smoke': 'Smoke at {node:w}',
    'water': 'Water at {node:w}',
    'heat': '{degrees:n} degC at {node:w}',
    'pressed': '{person:w} has pressed {pronoun:w} button',
    'robot_battery': 'The battery of the robot is nearly empty',
    'belt_off': "Nothing is heard of {person:w}'s belt; {pronoun:w} falls are not noticed",
    'notifier_dead': 'Nobody carries alarms to people',
    'overflow': 'more alarms than the book holds: causes were turned away',
    'a_test': 'a test by {by}: nobody is in danger',
    'journal_silent': 'it does not say why',
    'journal_not_restored': 'it has given nothing back in {seconds:n} s',
    'not_reached': 'robot could not reach {whom}: {why:a}',
    'worse': 'worse: {why:t}',
    'displaced': 'displaced by a worse one',
    'was_test': 'it was a test',
    'not_confirmed': 'nobody confirmed or cancelled it in time',
    'causes_over': 'its causes have been over for {seconds:n} s',
    'reminded': '{by:w} acknowledged it {minutes:n} min ago, and it is not resolved',
    'test_top': 'the test has come to its top',
    'restarted': 'after a restart',
    'goes_on_as': 'goes on as {alarm:w}',
    'goes_on_in': '{alarm:w} goes on in it',
    'nobody_else': 'there is nobody else to be told',
    'agent_event_silence': 'silence: {why:t}',
    'agent_event_timeout': 'timeout: {why:t}',
    'agent_event_battery_low': 'battery_low: {why:t}',
    'agent_event_lost_position': 'lost_position: {why:t}',
    'agent_event_no_place': 'no_place: {why:t}',
    'agent_event_operator': 'operator: {why:t}',
    'agent_event_estop': 'estop: {why:t}',
    'agent_event_released': 'released: {why:t}',
    'agent_event_moved': 'moved: {why:t}',
    'agent_event_retry': 'retry: {why:t}',
    'agent_event_abort': 'abort: {why:t}',
    'agent_event_stay': 'stay: {why:t}',
    'agent_event_return': 'return: {why:t}',
    'agent_event_fine': 'fine: {why:t}',
    'agent_event_help': 'help: {why:t}',
    'agent_event_observed': 'observed: {why:t}',
    'agent_event_over': 'over: {why:t}',
    'agent_event_acknowledged': 'acknowledged: {why:t}',
    'agent_event_confirmed': 'confirmed: {why:t}',
    'after_s': 'after {seconds:n} s',
    'percent': '{percent:n} %',
    'no_good_pose': 'no good pose for {seconds:n} s',
    'place_unknown': 'nobody knows where it is',
    'moved_to': 'to {x:n}, {y:n}',
    'another_waits': 'another emergency waits',
    'no_home': 'it never knew where it was, and home is not set',
    'operator_says': 'an operator says so',
    'person_says': '{person:w} says so',
    'of_alarm': 'alarm {alarm:w}',
    'estop_free': 'nobody holds the e-stop any more',
    'operator_let_go': 'the operator has let go',
    'somebody_holds': 'somebody holds it',
    'steers': '{source:w} steers',
    'sent_elsewhere': 'somebody has sent the robot elsewhere',
    'try_of': '{n:n} of {most:n}',
    'no_place_beside': 'no place to stand beside it',
    'planner_silent': 'the planner does not answer',
    'places_tried': '{why:t} ({n:n} places tried)',
    'idle': 'idle',
    'agent_confirm': 'confirm {person:w}: {what:e}',
    'agent_approach': 'approach {person:w}: {what:e}',
    'agent_observe': 'observe {person:w}: {what:e}',
    'agent_report': 'report {person:w}: {what:e}',
    'agent_stay': 'stay {person:w}: {what:e}',
    'agent_return': 'return {person:w}: {what:e}',
    'agent_held': 'held {person:w}: {what:e}',
    'agent_held_why': 'held {person:w}: {what:e}: {why:a}',
    'agent_operator': 'operator {person:w}: {what:e}',
    'agent_operator_why': 'operator {person:w}: {what:e}: {why:a}',
    'agent_give_up': 'give_up {person:w}: {what:e}',
    'agent_give_up_why': 'give_up {person:w}: {what:e}: {why:a}',
    'emergency_at': '{kinds:kinds}, at {node:w}',
    'emergency': '{kinds:kinds}',
    'found': 'robot is {metres:n} m from {whom}, {found:l}',
    'found_there': 'robot is there, {found:l}',
    'found_picture': 'picture',
    'found_no_picture': 'no picture',
    'found_picture_as': 'picture: {text}',
    'found_clip': 'clip',
    'found_no_clip': 'no clip',
    'found_clip_as': 'clip: {text}',
    'found_sound': 'sound',
    'found_no_sound': 'no sound',
    'found_sound_as': 'sound: {text}',
    'heard_times': 'heard something {n:n} times',
    'cancelled': 'cancelled',
    'estop': 'e-stop',
    'planning': 'planning',
    'planned': 'planned: {metres:n} m',
    'planned_moved': 'planned: {metres:n} m, goal moved by {moved:n} m',
    'waiting': 'waiting: {why:t}',
    'refused': 'refused: {why:t}',
    'stopped': 'stopped: {why:t}',
    'about': '{about:word}: {why:t}',
    'blocked_for': 'blocked for {seconds:n} s',
    'no_progress': 'no progress for {seconds:n} s',
    'no_progress_turning': 'no progress for {seconds:n} s of turning',
    'off_path': 'off the path by {metres:n} m, at most {most:n}',
    'path_begins_far': 'off the path: it begins {metres:n} m from the robot, at most {most:n}',
    'map_moved': 'the map moved by {metres:n} m',
    'no_map_yet': 'no map yet',
    'no_pose_yet': 'no pose yet',
    'no_pose': 'no pose any more',
    'no_goal_pose': 'the goal is no pose',
    'too_old': (
        'it was {seconds:n} s old when it came (order_age_max_s {most:n}): give it again; are '
        'the clocks set?'),
    'too_narrow': 'no way to the goal is wide enough',
    'too_narrow_now': 'no way to the goal is wide enough beside what stands there now',
    'robot_off_map': 'the robot is off the map, at {x:n}, {y:n}',
    'robot_too_near': (
        'the robot, at {x:n}, {y:n}, is too near to something to go anywhere: no free ground '
        'within {metres:n} m'),
    'goal_off_map': (
        'the goal {x:n}, {y:n} is off the map, which goes from {left:n}, {bottom:n} to '
        '{right:n}, {top:n}'),
    'goal_off_seen': (
        'the goal {x:n}, {y:n} lies in ground that nobody has seen yet, off the map, which '
        'goes from {left:n}, {bottom:n} to {right:n}, {top:n}'),
    'goal_outside': 'the goal {x:n}, {y:n} is off the map',
    'goal_unseen': (
        'the goal {x:n}, {y:n} lies in ground that nobody has seen yet, and the robot can '
        'stand nowhere within {metres:n} m of it'),
    'goal_in_wall': (
        'the goal {x:n}, {y:n} is in something, and the robot can stand nowhere within '
        '{metres:n} m of it'),
    'goal_too_near': (
        'the goal {x:n}, {y:n} is too near to something, and the robot can stand nowhere '
        'within {metres:n} m of it'),
    'obstacle': '{sensor:w}: obstacle {metres:n} m before the robot, at {degrees:n} degrees',
    'too_near': '{sensor:w}: something touches the robot, or is too near to measure',
    'touched': '{sensor:w}: something touches the robot',
    'edge': '{sensor:w}: an edge is ahead',
    'wheel': 'a wheel hangs in the air',
    'sensor_silent': '{sensor:w}: nothing is heard',
    'sensor_blind': '{sensor:w}: no valid readings from {low:n} to {high:n} degrees',
    'nobody_steers': 'nobody',
    'nobody_estop': 'nobody: e-stop, {why:t}',
    'nobody_held': 'nobody: held for {source:w}',
    'nobody_dead_man': 'nobody: the dead-man switch is not held',
    'nobody_locked': 'nobody: locked by {lock:w}',
    'nobody_locked_silent': 'nobody: locked by {lock:w}, which is silent',
    'estop_start': 'held since the start',
    'estop_asked': 'asked for on {topic:w}',
    'estop_lost': 'samples of the e-stop were lost',
    'estop_motors': 'motor faults {bits:w}',
    'robot_down': 'the robot does not run',
    'no_topic': (
        'this robot has no topic {topic:w} that others may publish: its parameter file lists '
        'none (topics)'),
    'no_release': 'this robot has no topic {topic:w}: its e-stop is released at the robot',
    'no_command': 'this robot has no command {command}; it has {commands}',
    'too_many_commands': 'too many commands at a time',
    'robot_mute': (
        'the robot does not answer; it may have been done all the same: look at the alarm'),
    'goal_given': 'the goal is given',
    'goal_given_no_word': 'the goal is given; the planner has not said yet whether there is a way',
    'goal_dropped': 'the goal is given up',
    'estop_pressed': 'the e-stop is pressed',
    'released': 'released',
    'estop_released': 'the e-stop is released',
    'agent_told': 'the agent is told',
    'robot_says': 'the robot says it',
    'camera_mute': 'the camera has not answered',
    'text_needed': 'text must be a text of 1 to {most:n} letters',
    'number_needed': '{key:w} = {value}: it must be a number',
    'no_such_alarm': 'no open alarm is called {name}: there are {alarms}',
    'no_alarm_open': 'no open alarm is called {name}: none is open',
    'several_alarms': '{name} has {n:n} alarms: name one of {alarms}',
    'only_suspected': (
        'alarm {alarm:w} is {state:w}: only what is suspected can be cancelled; write {example}'),
    'only_raised': (
        'alarm {alarm:w} is {state:w}: only what is raised and not acknowledged is told; write '
        '{example}'),
    'already': 'alarm {alarm:w} is {state:w} already',
    'nothing_suspected': 'nothing is suspected: what is raised is acknowledged and resolved',
    'nothing_noted': 'there is nothing to note: write {example}',
    'test_open': 'test {alarm:w} is not over: acknowledge it first',
    'no_room': '{n:n} alarms are open: there is no room for a test',
    'command_long': 'a command of {n:n} letters: at most {most:n}',
    'name_long': '{name}... is too long for a name: at most {most:n} letters',
    'orders_open': '{n:n} orders are open already',
    'level_mute': '{topic:w} has said nothing: {more}',
    'no_pillow': 'Pillow is not installed: pip install pillow',
    'no_pillow_camera': (
        'Pillow is not installed: pip install pillow, or set compressed_topic and '
        'observe_topic to {nothing}'),
    'device_silent': 'silent for {seconds:n} s: {hint}',
    'call_unable': 'this robot cannot be called: {why:t}',
    'call_library': 'voice needs aiortc: pip install aiortc sounddevice',
    'call_taken': 'somebody else talks with this robot',
    'call_not_started': 'the call cannot be started: {why}',
    'call_broken': 'the call has broken off',
    'blocked': 'blocked: {why:t}',
    'no_report': 'no report',
    'node_unheard': 'Node {node:w} was never heard: look at its battery and its place',
    'node_silent': 'Node {node:w} is silent: look at its battery and its place',
})
