# Copyright 2026 collision_sim developers
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

"""Message bytes laid out by NumPy against those of rclpy."""

from collision_sim.ros import messages
from collision_sim.ros.markers import clear_markers, collider_markers, contact_markers
from collision_sim.ros.messages import (CLOUD_FIELDS, marker_array, PointCloudWriter,
                                        PoseArrayWriter, read_pose, read_pose_array)
from collision_sim.scene import Scene
from collision_sim.simulation import Contacts
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from builtin_interfaces.msg import Duration, Time  # noqa: E402, I100
from geometry_msgs.msg import Point, Pose, PoseArray, PoseStamped  # noqa: E402
from geometry_msgs.msg import Quaternion, Vector3  # noqa: E402
from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402
from sensor_msgs.msg import PointCloud2, PointField  # noqa: E402
from std_msgs.msg import ColorRGBA, Header  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

FRAMES = ['a_link_fr'[:length] for length in range(10)] + ['bäse', 'Ω', '世界']
COUNTS = [0, 1, 2, 3, 7, 1000]
SECONDS, NANOSECONDS = -1, 999_999_999


def header(frame):
    return Header(stamp=Time(sec=SECONDS, nanosec=NANOSECONDS), frame_id=frame)


def points(rows):
    return [Point(x=x, y=y, z=z) for x, y, z in np.asarray(rows, dtype=float).tolist()]


def colors(rows):
    return [ColorRGBA(r=r, g=g, b=b, a=a) for r, g, b, a in np.asarray(rows, dtype=float).tolist()]


def assert_equal(ours, expected):
    """Check that the bytes are those of rclpy but for padding, which rclpy leaves undefined."""
    kind = type(expected)
    theirs = serialize_message(expected)
    assert len(ours) == len(theirs)
    for k in np.flatnonzero(np.frombuffer(ours, 'u1') != np.frombuffer(theirs, 'u1')).tolist():
        assert ours[k] == 0
        changed = ours[:k] + b'\x55' + ours[k + 1:]
        assert deserialize_message(changed, kind) == expected, 'byte %d is no padding' % k
    assert deserialize_message(ours, kind) == expected


@pytest.mark.parametrize('frame', FRAMES)
@pytest.mark.parametrize('count', COUNTS)
def test_pose_array(count, frame):
    position = np.random.default_rng(0).normal(size=(count, 3))
    expected = PoseArray(header=header(frame), poses=[
        Pose(position=point, orientation=Quaternion(w=1.0)) for point in points(position)])
    ours = PoseArrayWriter(frame, count).message(SECONDS, NANOSECONDS, position)
    assert_equal(ours, expected)


@pytest.mark.parametrize('frame', FRAMES)
@pytest.mark.parametrize('count', COUNTS)
def test_point_cloud(count, frame):
    position, velocity = np.random.default_rng(0).normal(size=(2, count, 3))
    rows = np.hstack([position, velocity]).astype('<f4')
    expected = PointCloud2(
        header=header(frame), height=1, width=count, point_step=24, row_step=24 * count,
        is_dense=True, is_bigendian=False, data=list(rows.tobytes()),
        fields=[PointField(name=name, offset=4 * k, datatype=PointField.FLOAT32, count=1)
                for k, name in enumerate(CLOUD_FIELDS)])
    ours = PointCloudWriter(frame, count).message(SECONDS, NANOSECONDS, position, velocity)
    assert_equal(ours, expected)


def built(marker, frame):
    """Build the message that a messages.Marker stands for."""
    seconds, rest = divmod(round(1e9 * marker.lifetime), 10 ** 9)
    x, y, z, w = map(float, marker.orientation)
    return Marker(
        header=header(frame), ns=marker.namespace, id=marker.number, type=marker.kind,
        action=marker.action, pose=Pose(position=points([marker.position])[0],
                                        orientation=Quaternion(x=x, y=y, z=z, w=w)),
        scale=Vector3(**dict(zip('xyz', map(float, marker.scale)))),
        color=colors([np.asarray(marker.color, 'f4')])[0],
        lifetime=Duration(sec=seconds, nanosec=rest),
        points=points(marker.points), colors=colors(marker.colors))


def assert_markers(markers, frame):
    ours = marker_array(SECONDS, NANOSECONDS, frame, markers)
    expected = MarkerArray(markers=[built(marker, frame) for marker in markers])
    assert_equal(ours, expected)


@pytest.mark.parametrize('frame', FRAMES)
@pytest.mark.parametrize('count', COUNTS)
def test_contacts(count, frame):
    random = np.random.default_rng(0)
    point, normal, impulse = random.normal(size=(3, count, 3))
    contacts = Contacts(np.arange(count), np.zeros(count, int), point, normal, impulse,
                        random.integers(1, 5, count))
    markers = contact_markers([contacts] if count else [], 1.0 / 3.0)
    assert [len(marker.points) for marker in markers] == [count, 2 * count]
    assert_markers(markers, frame)


def test_contacts_are_shown_where_and_as_long_as_they_are():
    contacts = Contacts(np.zeros(3, int), np.zeros(3, int), np.array([[1.0, 2, 3]] * 3),
                        np.array([[0, 0, 1.0], [0, 1.0, 0], [np.nan, 0, 0]]),
                        np.array([[0, 0, 2.0], [0, 1e9, 0], [0, 0, 1]]), np.array([1, 3, 1]))
    spheres, lines = contact_markers([contacts], 0.1)
    np.testing.assert_array_equal(spheres.points, [[1, 2, 3]] * 2)
    np.testing.assert_allclose(lines.points, [[1, 2, 3], [1, 2, 3.2], [1, 2, 3], [1, 2.5, 3]])
    np.testing.assert_array_equal(lines.colors[::2], spheres.colors)
    assert len(np.unique(spheres.colors, axis=0)) == 2


def test_kinds_and_actions_of_markers():
    for name in ('ADD', 'DELETE', 'DELETEALL', 'CUBE', 'SPHERE', 'CYLINDER', 'LINE_LIST',
                 'SPHERE_LIST', 'TRIANGLE_LIST'):
        assert getattr(messages, name) == getattr(Marker, name)


@pytest.mark.parametrize('frame', FRAMES)
def test_colliders_of_all_shapes(frame, tmp_path):
    (tmp_path / 'wedge.obj').write_text(
        'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n')
    scene = Scene.from_dict({
        'particles': {'position': [[0, 0, 1]]},
        'colliders': [
            {'name': 'ground', 'shape': 'plane', 'normal': [0, 0.6, 0.8]},
            {'name': 'ball', 'shape': 'sphere', 'radius': 2.0, 'inside': True},
            {'name': 'box', 'shape': 'box', 'size': [1, 2, 3], 'topic': 'box/pose'},
            {'name': 'pill', 'shape': 'capsule', 'radius': 0.1, 'length': 1},
            {'name': 'post', 'shape': 'cylinder', 'radius': 0.1, 'length': 1},
            {'name': 'wedge', 'shape': 'mesh', 'file': str(tmp_path / 'wedge.obj')}]})
    turned = np.array([0.5, -0.5, 0.5, 0.5])
    markers = collider_markers(scene, [(np.array([1.0, 2.0, k]), turned) for k in range(6)])
    assert len(markers) == 8 and len(markers[-1].points) == 12
    assert_markers(markers, frame)


def test_the_message_that_takes_markers_away():
    assert_markers(clear_markers(), 'world')


@pytest.mark.parametrize('frame', FRAMES)
def test_reads_the_pose_that_rclpy_writes(frame):
    pose = Pose(position=Point(x=1.5, y=-0.0, z=float('inf')),
                orientation=Quaternion(x=0.1, y=0.2, z=float('nan'), w=5e-324))
    message = read_pose(serialize_message(PoseStamped(header=header(frame), pose=pose)))
    assert message[:3] == (SECONDS, NANOSECONDS, frame)
    assert message.position == (1.5, 0.0, float('inf'))
    np.testing.assert_array_equal(message.orientation, (0.1, 0.2, np.nan, 5e-324))


def test_reads_the_poses_that_rclpy_writes():
    position = np.random.default_rng(1).normal(size=(5, 3))
    message = serialize_message(PoseArray(header=header('world'), poses=[
        Pose(position=point) for point in points(position)]))
    seconds, nanoseconds, frame, poses = read_pose_array(message)
    assert (seconds, nanoseconds, frame) == (SECONDS, NANOSECONDS, 'world')
    np.testing.assert_array_equal(poses[:, :3], position)
