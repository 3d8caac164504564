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

"""The pose topics of the colliders: what is taken, what is dropped and why."""

from collections import Counter
from functools import partial
import time

from collision_sim.core.pose_stream import PoseError, PoseStream
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

AHEAD = 1.0             # s; a stamp further in the future is wrong
WARN_PERIOD = 5.0       # s between warnings for the same reason
SECOND = 1_000_000_000  # ns
# Takes reliable and best-effort publishers; a burst of poses late by some ticks still fits.
QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


class PoseTopics:
    """
    Subscribes to the pose topics of a scene and keeps a PoseStream for each.

    Parameters
    ----------
    node : rclpy.node.Node
    scene : Scene
    seconds : callable
        Gives nanoseconds of the node's clock as the seconds of the streams.

    """

    def __init__(self, node, scene, seconds):
        """Subscribe to the topics of all colliders that have one."""
        self.frame_id = node.get_parameter('frame_id').value
        self.dropped = Counter()        # by collider and reason
        self.topics = {}
        self._node = node
        self._seconds = seconds
        self._warned = {}
        self._streams = {}
        for collider in scene.colliders:
            if collider.topic is not None:
                self._subscribe(collider.name, collider.topic)
        self.set_times(node.get_parameter('pose_delay').value,
                       node.get_parameter('pose_timeout').value)

    def _subscribe(self, name, topic):
        self._streams[name] = PoseStream()
        subscription = self._node.create_subscription(
            PoseStamped, topic, partial(self._take, name), QOS,
            qos_overriding_options=QoSOverridingOptions.with_default_policies())
        self.topics[name] = subscription.topic_name

    def set_times(self, delay, timeout):
        """Change the delay and the time-out of all streams [s]."""
        for stream in self._streams.values():
            if (stream.delay, stream.timeout) != (delay, timeout):
                stream.delay, stream.timeout = delay, timeout
                stream.restart()

    def restart(self):
        """Place the colliders at their poses at the next time that is asked for."""
        for stream in self._streams.values():
            stream.restart()

    def forget(self):
        """Drop all poses: their stamps are those of another time."""
        for stream in self._streams.values():
            stream.reset()

    def sample(self, times):
        """Pairs of collider name and PoseTrack at clock times [s], where any pose has come."""
        return [(name, stream.sample(times)) for name, stream in self._streams.items()
                if stream.newest is not None]

    def stale(self, now):
        """Names of the colliders whose poses have stopped for longer than the time-out."""
        return [name for name, stream in self._streams.items() if stream.newest is not None
                and now - stream.delay - stream.newest > stream.timeout]

    def _take(self, name, message):
        try:
            stream = self._streams[name]
            stamp = self._checked_stamp(message.header, stream)
            point, turn = message.pose.position, message.pose.orientation
            stream.add(stamp, (point.x, point.y, point.z), (turn.x, turn.y, turn.z, turn.w))
        except PoseError as error:
            self._drop(name, error)

    def _checked_stamp(self, header, stream):
        """Stamp in the seconds of the streams; a zero stamp means now."""
        if header.frame_id != self.frame_id:
            raise PoseError('frame', 'frame_id is %r instead of %r'
                            % (header.frame_id, self.frame_id))
        if header.stamp.nanosec >= SECOND:
            raise PoseError('stamp', '%d nanoseconds' % header.stamp.nanosec)
        now = self._seconds(self._node.get_clock().now().nanoseconds)
        if header.stamp.sec == 0 and header.stamp.nanosec == 0:
            return now
        stamp = self._seconds(header.stamp.sec * SECOND + header.stamp.nanosec)
        if stamp > now + AHEAD:
            raise PoseError('future', 'stamped %.3f s ahead of the clock' % (stamp - now))
        if stamp < now - stream.delay - stream.timeout:
            raise PoseError('stale', 'stamped %.3f s behind the clock' % (now - stamp))
        return stamp

    def _drop(self, name, error):
        """Count a refused pose, and warn from time to time."""
        key = name, error.reason
        self.dropped[key] += 1
        now = time.monotonic()
        if now - self._warned.get(key, -WARN_PERIOD) >= WARN_PERIOD:
            self._warned[key] = now
            self._node.get_logger().warning('%s: pose dropped, %s (%d so far)' % (
                self.topics[name], error, self.dropped[key]))
