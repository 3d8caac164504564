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

"""Bags of ROS 2 messages on disk, by the library rosbags; needs no ROS."""

from functools import partial
import os
import shutil
import struct

from collision_sim.checks import SceneError
from collision_sim.core.interrupts import held
from collision_sim.input_files import check_ordinary
from rosbags.interfaces import (Qos, QosDurability, QosHistory, QosLiveliness, QosReliability,
                                QosTime)
from rosbags.rosbag2 import (CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer,
                             WriterError)
from rosbags.rosbag2.storage_mcap import McapWriter, zstd
from rosbags.typesys import get_typestore, Stores

# The records that end an MCAP file without an index: DataEnd, Footer, and the magic bytes.
END = struct.pack('<BQI', 0x0F, 4, 0) + struct.pack('<BQQQI', 0x02, 20, 0, 0, 0) + b'\x89MCAP0\r\n'
COMPRESSED = b'\x28\xb5\x2f\xfd'      # begins what zstd made; no serialized message begins so
LARGEST = 2 ** 20   # bytes of a message that is decompressed
LEVEL = 1           # of zstd; its default takes two and a half times as long for the same size
BUFFER = 2 ** 23    # bytes; a chunk and its end go to disk in one piece
_FOR_EVER = QosTime(9_223_372_036, 854_775_807)
LATCHED = Qos(QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL,
              _FOR_EVER, _FOR_EVER, QosLiveliness.AUTOMATIC, _FOR_EVER, False)


class _EndedMcapWriter(McapWriter):
    """Ends the file after each chunk, so that it can be read whatever happens afterwards."""

    def __init__(self, path, compression):
        super().__init__(path, compression)
        self.compressor = partial(zstd.compress, level=LEVEL)
        self.bio.close()
        self.bio = open(self.path, 'r+b', BUFFER)
        self.bio.seek(0, os.SEEK_END)

    def close_chunk(self):
        super().close_chunk()
        self.bio.write(END)
        self.bio.flush()
        self.bio.seek(-len(END), os.SEEK_CUR)   # the next chunk takes its place


class _McapFolderWriter(Writer):
    STORAGE_PLUGINS = {StoragePlugin.MCAP: _EndedMcapWriter}


class BagWriter:
    """
    Writes one MCAP file, compressed by zstd, which has its name as soon as it is whole.

    Until then, and if the process is killed, what there is is an MCAP file without an index in
    the folder `<path>.draft`.

    Parameters
    ----------
    path : str
        Of the file; one that is there is replaced.
    topics : dict of str
        Types of the messages by the names of their topics, as geometry_msgs/msg/PoseArray.
    latched : collection of str
        Topics whose last message is kept for those who subscribe later.

    Raises
    ------
    SceneError
        For a path that cannot be written to.

    """

    def __init__(self, path, topics, latched=()):
        self._path, self._draft = os.path.realpath(path), f'{path}.draft'
        if os.path.isdir(path):
            raise SceneError('--record', path, 'must not be a folder')
        try:
            self._writer = _McapFolderWriter(self._draft, version=9,
                                             storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
        except WriterError:         # the first to make the folder writes
            raise SceneError('--record', self._draft, 'must not be there: it is being written, or '
                                                      'left by a run that was killed') from None
        self._empty = True
        types = get_typestore(Stores.ROS2_JAZZY)
        self._topics = {
            topic: self._writer.add_connection(
                topic, kind, typestore=types,
                offered_qos_profiles=[LATCHED] if topic in latched else [])
            for topic, kind in topics.items()}

    def write(self, topic, time, message):
        """Add a serialized message that is sent at a time [ns]."""
        self._empty = False
        try:
            self._writer.write(self._topics[topic], time, message)
        except OSError as error:        # such as a full disk
            raise OSError(error.errno, error.strerror, self._draft) from None

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        """Write the index and give the file its name; after an error the draft stays, if any."""
        with held():
            if kind is None:
                self._publish()
            elif self._empty:
                shutil.rmtree(self._draft)
            elif not issubclass(kind, OSError):
                self._writer.close()

    def _publish(self):
        self._writer.close()
        name = os.path.basename(self._draft)
        draft = os.path.join(self._draft, f'{name}.mcap')
        with open(draft, 'rb') as file:
            os.fsync(file.fileno())
        os.replace(draft, self._path)
        shutil.rmtree(self._draft)


def read_bag(path, topics, kind):
    """
    Read the messages of some topics.

    Parameters
    ----------
    path : str
        A folder as `ros2 bag record` writes it, or a file of one, .mcap or .db3.
    topics : collection of str
        Names; at least one of them must be there.
    kind : str
        Type that their messages must have, as geometry_msgs/msg/PoseStamped.

    Returns
    -------
    start : int [ns]
        Time of the first message of the bag, whatever its topic.
    messages : list of (int [ns], str, bytes)
        Time when it was received, topic and serialized message, in the order of time.

    Raises
    ------
    SceneError, OSError
        For what is not a bag or not whole, and for topics that are not there or of another type.

    """
    try:
        _check_files(path)
        with Reader(path) as reader:
            there = {connection.topic: connection.msgtype for connection in reader.connections}
            wanted = [connection for connection in reader.connections
                      if connection.topic in topics and connection.msgtype == kind]
            messages = [(time, connection.topic, _decompressed(bytes(data)))
                        for connection, time, data in reader.messages(wanted)] if wanted else []
            start = reader.start_time
    except OSError:
        raise
    except Exception as error:      # whatever a broken file makes its reader raise
        raise SceneError('--poses', path, f'must be a bag that is whole: {error}') from None
    if not wanted:
        listing = ', '.join(f'{topic} ({there[topic]})' for topic in sorted(there))
        raise SceneError('--poses', path, f'must have {kind} on {" or ".join(sorted(topics))}; '
                                          f'there is {listing or "nothing"}')
    messages.sort(key=lambda message: message[0])
    return start, messages


def _check_files(path):
    """Raise OSError where a file of a bag is a pipe or a device, which might never end."""
    if not os.path.isdir(path):
        check_ordinary(path)
        return
    for entry in os.scandir(path):
        if not entry.is_dir():
            check_ordinary(entry.path)


def _decompressed(message):
    """
    Give a message of a bag whose messages are compressed one by one.

    That they are is said by the metadata of the bag, but not in each of its files.
    """
    if not message.startswith(COMPRESSED):
        return message
    return zstd.ZstdDecompressor().decompress(message, LARGEST)
