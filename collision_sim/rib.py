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

"""
Meshes in RenderMan RIB files: the polygons of Polygon, PointsPolygons, PointsGeneralPolygons.

Transformations are followed from WorldBegin on (from the start of a file without it), so that the
mesh is in world coordinates. Requests that say how things look are read over; shapes other than
polygons, and requests that bring in other files or objects, are refused.

Source of the grammar: The RenderMan Interface, version 3.2, Pixar 2000, appendix C.
"""

from array import array
import math
import re

from collision_sim.input_files import as_text, refuse_underscores
import numpy as np

TOKEN = re.compile(rb'#[^\n]*|"((?:[^"\\]|\\.)*)"|([\[\]])|([A-Za-z][A-Za-z0-9_:]*)|'
                   rb'([^\s\[\]"#]+)|(")', re.DOTALL)
DEEPEST = 1000              # blocks within blocks
REFUSED = frozenset((
    'Blobby CoordSysTransform Cone Curves Cylinder Deformation Disk Geometry '
    'HierarchicalSubdivisionMesh Hyperboloid MotionBegin NuPatch ObjectBegin ObjectInstance '
    'Paraboloid Patch PatchMesh Perspective Points Procedural Procedural2 ReadArchive Skew '
    'SolidBegin Sphere SubdivisionMesh Torus TrimCurve Volume').split())
BEGINS = {'AttributeBegin', 'TransformBegin', 'FrameBegin', 'WorldBegin'}
ENDS = {'AttributeEnd', 'TransformEnd', 'FrameEnd', 'WorldEnd'}
COUNTS = {'Translate': 3, 'Scale': 3, 'Rotate': 4, 'ConcatTransform': 16, 'Transform': 16,
          'Identity': 0}
POLYGONS = {'Polygon': 0, 'PointsPolygons': 2, 'PointsGeneralPolygons': 3}  # arrays before "P"


def read_rib(data):
    """
    Give the polygons of a RIB file.

    Parameters
    ----------
    data : bytes
        Content of the file, text.

    Returns
    -------
    vertices, corners, sizes, remarks
        As in mesh_files.py.

    Raises
    ------
    ValueError
        For what is no such file, or a request that is refused.

    """
    place, saved = np.eye(4), []
    vertices, corners, sizes, count = [], [], [], 0
    for request, number, words in _requests(as_text(data)):
        if request in REFUSED:
            raise ValueError(f'line {number}: {request} is not read, only polygons are')
        if request in BEGINS:
            saved.append(place)
            if len(saved) > DEEPEST:
                raise ValueError(f'line {number}: more than {DEEPEST} blocks within blocks')
            place = np.eye(4) if request == 'WorldBegin' else place
        elif request in ENDS:
            if not saved:
                raise ValueError(f'line {number}: {request} without a beginning')
            place = saved.pop()
        elif request in COUNTS:
            place = _moved(place, request, _numbers(words, COUNTS[request], request, number))
        elif request in POLYGONS:
            points, faces, many = _polygons(request, number, words)
            vertices.append(points @ place[:3, :3].T + place[:3, 3])
            corners.append(faces + count)
            sizes.append(many)
            count += len(points)
    if not sizes:
        raise ValueError('there are no polygons in it')
    return np.concatenate(vertices), np.concatenate(corners), np.concatenate(sizes), []


def _requests(data):
    """Give name, line and arguments of each request; arguments: str, float or array."""
    request, first, words, inner, line, last = None, 0, [], None, 1, 0
    for found in TOKEN.finditer(data):
        line += data.count(b'\n', last, found.start())
        last = found.start()
        text, bracket, name, number, open_quote = found.groups()
        if open_quote or (number is not None and not number.isascii()):
            raise ValueError(f'line {line}: no text of RIB')
        if name is not None and inner is None:
            if request is not None:
                yield request, first, words
            request, first, words = name.decode('ascii'), line, []
        elif bracket is not None:
            if (bracket == b'[') != (inner is None):
                raise ValueError(f'line {line}: brackets must not be nested')
            if inner is None:
                inner = array('d')
            else:
                words.append(inner)
                inner = None
        elif number is not None or name is not None:
            (words if inner is None else inner).append(_float(number or name, line))
        elif text is not None and inner is None:
            words.append(text.decode('ascii', 'replace'))
    if inner is not None:
        raise ValueError(f'line {line}: the file ends within brackets')
    if request is not None:
        yield request, first, words


def _float(word, line):
    try:
        return float(*refuse_underscores([word]))
    except ValueError:
        raise ValueError(f'line {line}: {word[:40]!r} is no number') from None


def _numbers(words, count, request, line):
    """Give the arguments of a transformation, in brackets or not."""
    numbers = words[0] if len(words) == 1 and isinstance(words[0], array) else words
    if len(numbers) != count or not all(
            isinstance(x, float) and math.isfinite(x) for x in numbers):
        raise ValueError(f'line {line}: {request} must have {count} finite numbers')
    return np.array(numbers)


def _moved(place, request, numbers):
    """Give the transformation (4, 4) after a request; the new one acts first."""
    step = np.eye(4)
    if request == 'Translate':
        step[:3, 3] = numbers
    elif request == 'Scale':
        step[:3, :3] = np.diag(numbers)
    elif request == 'Rotate':
        step[:3, :3] = _rotation(math.radians(numbers[0]), numbers[1:])
    elif request != 'Identity':
        step = numbers.reshape(4, 4).T      # RIB multiplies rows by matrices
        if not np.array_equal(step[3], (0.0, 0.0, 0.0, 1.0)):
            raise ValueError(f'{request} must end with the column 0 0 0 1')
    return step if request in ('Transform', 'Identity') else place @ step


def _rotation(angle, axis):
    """Rotation matrix by Rodrigues' formula."""
    size = math.hypot(*axis)
    if not size > 0.0:
        raise ValueError('Rotate must have an axis')
    x, y, z = axis / size
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * across + (1.0 - math.cos(angle)) * across @ across


def _polygons(request, line, words):
    """Give points (V, 3), corners and sizes of the polygons of one request."""
    arrays = words[:POLYGONS[request]]
    parameters = words[POLYGONS[request]:]
    points = [value for key, value in zip(parameters[::2], parameters[1::2])
              if isinstance(key, str) and key.split()[-1:] == ['P'] and isinstance(value, array)]
    if len(points) != 1 or len(points[0]) % 3 or not all(
            isinstance(numbers, array) for numbers in arrays):
        raise ValueError(f'line {line}: {request} must have its arrays and "P" [x y z ...]')
    points = np.array(points[0]).reshape(-1, 3)
    if request == 'Polygon':
        return points, np.arange(len(points)), np.array([len(points)])
    *loops, sizes, corners = (_whole(numbers, request, line) for numbers in arrays)
    if loops and (loops[0] != 1).any():
        raise ValueError(f'line {line}: polygons with holes are not read')
    if (sizes < 0).any() or sizes.sum() != len(corners):
        raise ValueError(f'line {line}: {request} must have as many corners as it says')
    return points, _in_range(corners, len(points), request, line), sizes


def _whole(numbers, request, line):
    numbers = np.array(numbers)
    if not (np.abs(numbers) < 2 ** 31).all() or (numbers != np.floor(numbers)).any():
        raise ValueError(f'line {line}: {request} must count in whole numbers')
    return numbers.astype(np.int64)


def _in_range(corners, count, request, line):
    """Corners of one request: those of the next begin after its points."""
    bad = np.flatnonzero((corners < 0) | (corners >= count))
    if len(bad):
        raise ValueError(f'line {line}: {request}: corner {corners[bad[0]]} is out of range '
                         f'({count} vertices)')
    return corners
