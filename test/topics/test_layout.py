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

"""Declaring layouts: accepted shapes, their properties, and each error with its remedy."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.topics.layout import Layout

pytest.importorskip('sensor_msgs', reason='the ROS 2 message packages are not installed')


def _slot(kind: str, **attributes: Any) -> Any:
    return type(kind, (), attributes)()


def _interface(name: str, **fields: tuple[Any, Any]) -> Any:
    """Make a class that describes itself as those of rosidl do."""
    def init(self: Any) -> None:
        for field, (_, default) in fields.items():
            setattr(self, field, default)

    return type(name, (), {
        '__init__': init, '__module__': 'made_up_msgs.msg._it',
        'get_fields_and_field_types': staticmethod(lambda: dict.fromkeys(fields, '')),
        'SLOT_TYPES': tuple(slot for slot, _ in fields.values())})


BASIC = {name: _slot('BasicType', typename=name)
         for name in ('int32', 'double', 'boolean', 'octet', 'uint8', 'char', 'wchar',
                      'long double')}
STRING = _slot('UnboundedString')


@pytest.mark.parametrize('name', ['sensor_msgs/Imu', 'sensor_msgs/msg/Imu'])
def test_both_spellings_and_the_class_give_the_same_layout(name: str) -> None:
    from sensor_msgs.msg import Imu
    shape = {'header.frame_id': 'imu_link'}
    layout = Layout.compile(name, shape)
    assert layout.type_name == 'sensor_msgs/msg/Imu'
    for other in (Imu, Imu()):
        again = Layout.compile(other, shape)
        assert (again.type_name, again.prototype) == (layout.type_name, layout.prototype)


def test_dotted_and_nested_keys_mean_the_same_and_mix() -> None:
    dotted = Layout.compile('sensor_msgs/Imu', {'header.frame_id': 'a', 'header.stamp.sec': 5})
    nested = Layout.compile('sensor_msgs/Imu', {'header': {'frame_id': 'a', 'stamp': {'sec': 5}}})
    mixed = Layout.compile('sensor_msgs/Imu', {'header': {'frame_id': 'a'}, 'header.stamp.sec': 5})
    assert dotted.prototype == nested.prototype == mixed.prototype


def test_a_layout_has_its_sizes_and_its_stamp() -> None:
    layout = Layout.compile('sensor_msgs/Imu', {'header.frame_id': 'imu_link'})
    assert (layout.size, layout.max_size) == (324, 324)
    assert (layout.stamp_offset, layout.tail, layout.tail_offset) == (4, None, None)
    assert len(layout.prototype) == 324
    assert layout.length(layout.prototype) == 324
    assert repr(layout) == '<Layout sensor_msgs/msg/Imu, 324 bytes>'


@pytest.mark.parametrize(('name', 'offset'), [
    ('std_msgs/Header', 4), ('sensor_msgs/Range', 4), ('rosgraph_msgs/Clock', 4),
    ('std_msgs/Bool', None), ('geometry_msgs/Twist', None), ('std_msgs/Empty', None),
    ('builtin_interfaces/Time', None), ('visualization_msgs/MarkerArray', None),
])
def test_stamp_offset_is_given_for_messages_that_begin_with_a_stamp(name: str,
                                                                    offset: int | None) -> None:
    assert Layout.compile(name).stamp_offset == offset


def test_a_tail_has_a_size_without_and_with_its_elements() -> None:
    layout = Layout.compile('sensor_msgs/Image', {'encoding': 'rgb8'}, tail=640 * 480 * 3)
    assert layout.tail == 'data'
    assert layout.tail_item_size == 1
    assert layout.size == layout.tail_offset == 48
    assert layout.max_size == 48 + 640 * 480 * 3
    assert 'data[:921600]' in repr(layout)
    aligned = Layout.compile('std_msgs/Float64MultiArray', tail=2)
    assert (aligned.size, aligned.tail_offset, aligned.max_size) == (16, 20, 36)
    text = Layout.compile('std_msgs/String', tail=256)
    assert (text.size, text.tail_offset, text.max_size) == (9, 8, 265)
    none = Layout.compile('std_msgs/String', tail=0)
    assert none.size == none.max_size == 9


def test_a_new_buffer_holds_the_prototype_and_is_aligned_for_numpy() -> None:
    for tail in (0, 1, 100):
        layout = Layout.compile('std_msgs/Float64MultiArray', {'layout.dim': [{'label': 'abc'}]},
                                tail=tail)
        buffer = layout.new_buffer()
        assert len(buffer) == layout.max_size
        assert bytes(buffer[:layout.size]) == layout.prototype
        assert np.frombuffer(buffer, np.uint8).ctypes.data % 8 == 4
        buffer[0:1] = b'\0'
    imu = Layout.compile('sensor_msgs/Imu')
    assert imu.view(imu.new_buffer()).orientation_covariance.flags.aligned


def test_first_values_and_defaults_of_the_message_are_in_the_prototype() -> None:
    layout = Layout.compile('sensor_msgs/LaserScan', {
        'angle_min': -1.5, 'ranges': [1.0, 2.5], 'intensities': 2, 'header.stamp.sec': -3})
    view = layout.view(layout.prototype)
    assert (view.angle_min, view.ranges.tolist(), view.header.stamp.sec) == (-1.5, [1, 2.5], -3)
    pose = Layout.compile('geometry_msgs/PoseArray', {'poses': 2})
    assert pose.view(pose.prototype).poses[1].orientation.w == 1.0


def test_what_is_not_fixed_is_as_the_message_is_made() -> None:
    cls = _interface('Defaults', text=(STRING, 'hello'), flag=(BASIC['boolean'], True),
                     numbers=(_slot('UnboundedSequence', value_type=BASIC['int32']), [4, 5]),
                     names=(_slot('Array', value_type=STRING, size=2), ['', 'b']))
    layout = Layout.compile(cls)
    assert layout.type_name == 'made_up_msgs/msg/Defaults'
    assert layout.to_dict(layout.prototype) == {
        'text': 'hello', 'flag': True, 'numbers': [4, 5], 'names': ['', 'b']}
    assert Layout.compile(cls, {'numbers': 0, 'text': ''}).to_dict(
        Layout.compile(cls, {'numbers': 0, 'text': ''}).prototype)['numbers'] == []


def test_fields_lists_everything_with_its_place() -> None:
    layout = Layout.compile('diagnostic_msgs/DiagnosticArray', {'status': [
        {'name': 'a', 'values': [{'key': 'k', 'value': 'v'}]}, {}]})
    fields = {field.name: field for field in layout.fields()}
    assert list(fields)[:4] == ['header.stamp.sec', 'header.stamp.nanosec', 'header.frame_id',
                                'status']
    key = fields['status[0].values[0].key']
    assert (key.type_name, key.fixed, key.count, key.nbytes) == ('string', 'k', 1, 2)
    assert layout.prototype[key.offset:key.offset + 2] == b'k\0'
    assert layout.prototype[key.offset - 4:key.offset] == b'\2\0\0\0'
    assert (fields['status'].count, fields['status'].nbytes) == (2, 0)
    assert 'status[1].values[0].key' not in fields


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 5), st.text(max_size=9).filter(lambda text: '\0' not in text),
       st.integers(0, 9))
def test_fields_never_overlap_and_stay_inside(poses: int, frame: str, tail: int) -> None:
    for layout in (Layout.compile('nav_msgs/Path', {'header.frame_id': frame, 'poses': poses}),
                   Layout.compile('sensor_msgs/JointState', {'name': [frame] * poses,
                                                             'position': poses}, tail=tail)):
        end = 4
        for field in layout.fields():
            first = field.offset if field.count_offset is None else field.count_offset
            assert end <= first <= end + 7
            end = field.offset + field.nbytes if field.nbytes else max(end, first + 4)
            if field.count_offset is None:
                assert field.offset % (field.nbytes // field.count) in (0, 4)
        assert end == layout.max_size


def test_compiling_loads_no_rclpy() -> None:
    code = ('import sys; from rt_robot_os.topics.layout import Layout; '
            "x = Layout.compile('sensor_msgs/Imu'); x.view(x.new_buffer()); "
            "print('rclpy' in sys.modules)")
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True,
                          timeout=60, env={'PYTHONPATH': ':'.join(sys.path)})
    assert done.stdout.strip() == 'False'


def test_a_big_endian_host_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('rt_robot_os.topics._cdr.sys', SimpleNamespace(byteorder='big'))
    with pytest.raises(LayoutError, match='this host is big-endian.*little-endian host'):
        Layout.compile('std_msgs/Bool')


@pytest.mark.parametrize(('name', 'words'), [
    ('Imu', ["'Imu'", 'package/msg/Type']),
    ('sensor_msgs/srv/Imu', ['sensor_msgs/srv/Imu', 'package/msg/Type']),
    ('no_such_msgs/Imu', ["'no_such_msgs/Imu'", 'install the ROS 2 package', 'source']),
    ('sensor_msgs/msg/Imuu', ["no message 'Imuu'", 'Imu']),
    (int, ['int', 'is not a ROS 2 message type', 'sensor_msgs/msg/Imu']),
    (None, ['None', 'is not a ROS 2 message type']),
])
def test_an_unknown_type_is_named_with_a_remedy(name: Any, words: list[str]) -> None:
    with pytest.raises(LayoutError) as caught:
        Layout.compile(name)
    assert all(word in str(caught.value) for word in words)


@pytest.mark.parametrize(('name', 'shape', 'words'), [
    ('sensor_msgs/Imu', {'heder.frame_id': 'x'}, ["'heder'", "did you mean 'header'?"]),
    ('sensor_msgs/Imu', {'header.frame': 'x'}, ["'header.frame'", 'std_msgs/msg/Header',
                                                "did you mean 'frame_id'?"]),
    ('std_msgs/Empty', {'data': 1}, ["'data'", 'it has no fields']),
    ('sensor_msgs/Imu', {'header.frame_id': 5},
     ["'header.frame_id'", 'string', '5', 'give its string']),
    ('sensor_msgs/Imu', {'header.frame_id': 'a\0b'}, ["'a\\x00b'", 'without NUL']),
    ('sensor_msgs/Imu', {'header.frame_id': '\ud800'}, ['UTF-8']),
    ('sensor_msgs/Imu', {'header': 'imu'}, ["'header'", "'imu'", 'mapping']),
    ('sensor_msgs/Imu', {'header': {'frame_id': 'a'}, 'header.frame_id': 'b'},
     ["'header.frame_id'", 'twice', "'a'", "'b'"]),
    ('sensor_msgs/Imu', {'header': 'a', 'header.frame_id': 'b'}, ["'header'", 'twice']),
    ('sensor_msgs/Imu', {3: 'x'}, ['key 3', 'strings']),
    ('sensor_msgs/Imu', ['header'], ['the shape', 'mapping']),
    ('sensor_msgs/Imu', {'orientation.x': 'one'}, ["'orientation.x'", 'double', "'one'"]),
    ('sensor_msgs/Imu', {'orientation_covariance': 8}, ['array of 9', '8']),
    ('sensor_msgs/Imu', {'orientation_covariance': [0.0] * 8}, ['array of 9', '8']),
    ('sensor_msgs/LaserScan', {'ranges': -1}, ["'ranges'", '-1', '0 or more']),
    ('sensor_msgs/LaserScan', {'ranges': 'many'}, ["'ranges'", "'many'", 'how many']),
    ('sensor_msgs/LaserScan', {'ranges': 2.0}, ["'ranges'", '2.0', 'how many']),
    ('sensor_msgs/LaserScan', {'ranges': True}, ["'ranges'", 'True', 'how many']),
    ('sensor_msgs/LaserScan', {'ranges': [1.0, 'x']}, ["'ranges[1]'", "'x'"]),
    ('sensor_msgs/LaserScan', {'angle_min': 1e300}, ["'angle_min'", '32 bit']),
    ('sensor_msgs/LaserScan', {'ranges': 10 ** 12}, ["'ranges'", 'at most', 'shorter']),
    ('nav_msgs/Path', {'poses': 10 ** 12}, ["'poses'", 'at most 65536']),
    ('nav_msgs/Path', {'poses': [{'pose.position': {'q': 1}}]},
     ["'poses[0].pose.position.q'", 'geometry_msgs/msg/Point']),
    ('nav_msgs/Path', {'poses': ['x']}, ["'poses[0]'", "'x'", 'mapping']),
    ('sensor_msgs/JointState', {'name': ['a', 4]}, ["'name[1]'", '4', 'string']),
    ('sensor_msgs/JointState', {'name': 'left'}, ["'name'", "'left'", 'list']),
    ('sensor_msgs/NavSatStatus', {'status': 300}, ["'status'", '300', '-128 to 127']),
    ('sensor_msgs/BatteryState', {'present': 1}, ["'present'", 'true or false']),
    ('sensor_msgs/BatteryState', {'power_supply_health': True}, ['an integer', 'True']),
    ('diagnostic_msgs/DiagnosticStatus', {'level': b'ab'}, ["'level'", 'one byte']),
    ('shape_msgs/SolidPrimitive', {'dimensions': 4}, ["'dimensions'", 'at most 3', '4']),
    ('type_description_interfaces/FieldType', {'nested_type_name': 'x' * 256},
     ["'nested_type_name'", 'at most 255', '256', 'shorter']),
])
def test_a_mistake_in_the_shape_names_type_field_value_and_remedy(
        name: str, shape: Any, words: list[str]) -> None:
    with pytest.raises(LayoutError) as caught:
        Layout.compile(name, shape)
    package, short = name.split('/')
    text = str(caught.value)
    assert all(word in text for word in [f'{package}/msg/{short}', *words]), text


@pytest.mark.parametrize(('name', 'shape', 'tail', 'words'), [
    ('sensor_msgs/Imu', {}, 5, ["'linear_acceleration_covariance'", 'tail=5', 'sequence']),
    ('nav_msgs/Path', {}, 5, ["'poses'", 'tail=5', 'fix its length']),
    ('sensor_msgs/PointCloud2', {}, 5, ["'is_dense'", 'tail=5']),
    ('geometry_msgs/PoseStamped', {}, 5, ["'pose'", 'tail=5']),
    ('diagnostic_msgs/AddDiagnostics', {}, 5, ['no message']),
    ('std_msgs/Empty', {}, 5, ['tail=5', 'no fields']),
    ('std_msgs/String', {}, -1, ["'data'", '-1', '0 or more']),
    ('std_msgs/String', {}, 'all', ["'data'", "'all'"]),
    ('std_msgs/String', {}, 1 << 40, ["'data'", 'at most']),
    ('std_msgs/String', {'data': 'x'}, 9, ["'data'", 'remove one']),
    ('type_description_interfaces/FieldType', {}, 256, ["'nested_type_name'", '255', '256']),
])
def test_a_tail_that_cannot_be_is_refused(name: str, shape: Any, tail: Any,
                                          words: list[str]) -> None:
    with pytest.raises(LayoutError) as caught:
        Layout.compile(name, shape, tail=tail)
    assert all(word in str(caught.value) for word in words), str(caught.value)


@pytest.mark.parametrize('kind', ['char', 'wchar', 'long double', 'wstring'])
def test_types_that_no_slot_can_hold_are_refused(kind: str) -> None:
    slot = _slot('UnboundedWString') if kind == 'wstring' else BASIC[kind]
    for whole in (slot, _slot('UnboundedSequence', value_type=slot)):
        with pytest.raises(LayoutError, match=f'made_up_msgs/msg/Bad: field .it. is a {kind}'):
            Layout.compile(_interface('Bad', it=(whole, None)))


def test_a_field_that_is_a_keyword_of_python_is_refused() -> None:
    with pytest.raises(LayoutError, match="field 'class' cannot be an attribute"):
        Layout.compile(_interface('Bad', **{'class': (BASIC['int32'], 0)}))


def test_a_nested_type_that_is_not_installed_is_named() -> None:
    slot = _slot('NamespacedType', namespaces=['no_such_msgs', 'msg'], name='Thing')
    with pytest.raises(LayoutError, match='field .it. is a no_such_msgs.msg.Thing.*install'):
        Layout.compile(_interface('Bad', it=(slot, None)))
