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
The next event of the event-driven method: which path a particle takes, and what ends it.

A path ends where the particle comes to another surface, stops, breaks away, is let go of, or
reaches the end of a face; and where the integrator has to begin a new step.
"""

from math import inf, log1p

from collision_sim.core.courses import (accelerates, frame_acceleration, is_uniform,
                                        material_velocity, quickest)
from collision_sim.core.extrapolation import integrate, stiffness
from collision_sim.core.jit import inlined, kernel
from collision_sim.core.meeting import BALANCED, NOBODY, ZERO
from collision_sim.core.paths import first_time, Path, state_at, STIFF_TOLERANCE, TOLERANCE
from collision_sim.core.rules import NONE
from collision_sim.core.shapes import KINETIC, SIDE, WET
from collision_sim.core.surfaces import face_of, FACES, faces, is_end, is_flat, region_of
from collision_sim.core.sustained import (at_rest, can_rest, FLIES, held, pull, pull_slack, RESTS,
                                          SLIDES)
from collision_sim.core.vectors import add_scaled, cross, dot, length, subtract

STOPPED = 1e-13         # share of its velocity at which a slide has come to a stop
STIFF = 4.0             # rate times step from which a step is stiff
LEAST = 1e-13           # share of the step of the simulation below which errors do not count
HALVINGS = 80           # bisections for the time of an event


@inlined
def _decay_rate(linear, wet, coefficient, normal):
    """Rate k [1/s] at which drag and wet friction slow a straight slide."""
    return linear + coefficient * normal if wet else linear


@inlined
def _flight(forces, t, x, v):
    """Path of free flight."""
    if forces.quadratic > 0.0:
        return Path(FLIES, NOBODY, t, x, v, False, ZERO, 0.0, 0.0, False)
    k = forces.linear
    return Path(FLIES, NOBODY, t, x, v, True, add_scaled(forces.gravity, k, forces.wind), k, 0.0,
                False)


@kernel
def _straight(world, forces, here, courses, holds, t, x, v):
    """
    Give the closed form of a slide, if there is one: on one flat surface, straight on or smooth.

    Returns
    -------
    path : Path
        Not closed where there is none.
    stop : float [s]
        When it comes to a stop; infinite if it does not.

    """
    table, poses = world.table, world.poses
    a, normal = held(world, forces, here, courses, holds, t, x, v)
    curved = Path(SLIDES, holds, t, x, v, False, a, 0.0, 2.0 * length(a), False)
    s, c = holds[0], holds[0] // FACES
    flat = is_flat(table, c, s % FACES, table[c, SIDE])
    dragged = forces.quadratic > 0.0
    if holds[1] != NONE or not flat or not is_uniform(courses, here, c) or dragged:
        return curved, inf
    obj = material_velocity(courses, poses, here, c, t, x)
    w = subtract(v, obj)
    k = _decay_rate(forces.linear, world.rules.wet, forces.grip * table[c, WET], normal[0])
    if k > 0.0 and accelerates(courses, here, c):
        return curved, inf
    relative = subtract(a, frame_acceleration(courses, poses, here, c, t, x, ZERO))
    path = Path(SLIDES, holds, t, x, v, True, add_scaled(a, k, v), k, 0.0,
                False)
    if forces.grip * table[c, KINETIC] == 0.0:
        return path, inf
    speed, brake = length(w), length(relative)
    if speed == 0.0:
        return path, inf
    across = length(cross(w, relative))
    if across > BALANCED * speed * (length(pull(forces, v)) + normal[0]):
        return curved, inf
    if dot(w, relative) >= 0.0:
        return path, inf
    steady = brake - k * speed      # deceleration that is left at rest
    if steady <= 0.0:
        return path, inf
    if k == 0.0:
        return path, t + speed / brake
    return path, t + log1p(k * speed / steady) / k


@inlined
def _stop_time(world, here, courses, holds, t, x, v, a):
    """Time until a slide comes to a stop if it goes on braking as now; infinite if it does not."""
    poses = world.poses
    first = inf
    for k in range(3):
        c = holds[k] // FACES
        if holds[k] != NONE and world.table[c, KINETIC] > 0.0:
            w = subtract(v, material_velocity(courses, poses, here, c, t, x))
            brake = -dot(w, subtract(a, frame_acceleration(courses, poses, here, c, t, x, ZERO)))
            if brake > 0.0:
                first = min(first, dot(w, w) / brake)
    return first


@inlined
def _stopped_on(world, here, courses, holds, t, x, v, x1, v1, t1, slow):
    """
    Surface relative to which a particle has come to a stop, `slow`, in a step from t to t1.

    Returns
    -------
    surface : int
        NONE if there is none.
    reversed : bool
        Whether the step went past a stop.

    """
    poses = world.poses
    for k in range(3):
        c = holds[k] // FACES
        if holds[k] != NONE and world.table[c, KINETIC] > 0.0:
            w = subtract(v, material_velocity(courses, poses, here, c, t, x))
            w1 = subtract(v1, material_velocity(courses, poses, here, c, t1, x1))
            if length(w) > 0.0 and length(w1) <= max(STOPPED * length(w), slow):
                return holds[k], False
            if dot(w, w1) < 0.0:
                return NONE, True
    return NONE, False


@kernel
def _integrated(world, forces, here, courses, work, path, t, duration, pace):
    """
    How far one integrator step from the start of a path is accurate, but not past a stop.

    Returns
    -------
    end, pace : float [s]
        Until when, and a guess for the next step.
    bend : float [m/s^2]
        Bound on the acceleration.
    stiff : bool
        Which rule integrates it.
    stopped : int
        Surface on which the particle is then at rest, or NONE.

    """
    x, v = path.x, path.v
    a, normal = held(world, forces, here, courses, path.holds, t, x, v)
    _, _, rates = stiffness(world, forces, here, courses, path.holds, t, x, v, normal)
    h, rate = min(pace, duration - t), 0.0
    for k in range(3):
        if path.holds[k] != NONE:
            rate = max(rate, quickest(courses, here, path.holds[k] // FACES))
    if rate > 0.0:
        h = min(h, 0.5 / rate)
    halting = _stop_time(world, here, courses, path.holds, t, x, v, a)
    h = min(h, halting)
    for _ in range(HALVINGS):
        stiff = h * rates[2] > STIFF
        x1, v1, error = integrate(world, forces, here, courses, work, stiff, path.holds, t, x, v,
                                  h)
        stopped, past = _stopped_on(world, here, courses, path.holds, t, x, v, x1, v1, t + h,
                                    STOPPED * duration * length(a))
        limit = STIFF_TOLERANCE if stiff else TOLERANCE
        if (error <= limit or h <= LEAST * duration) and not past:
            break           # a jump of the curvature is crossed in a step that does not count
        h *= 0.5 if error <= 1e3 * limit or past else 0.25
    b, _ = held(world, forces, here, courses, path.holds, t + h, x1, v1)
    if h < halting:
        pace = h * (2.0 if error <= (0.1 if stiff else 1e-3) * limit else 1.0)
    end = duration if h == duration - t else t + h
    return end, max(pace, h), 2.0 * max(length(a), length(b)), stiff, stopped


@inlined
def _pulls(world, forces, here, courses, holds, t, x, v):
    """Surface that would have to pull to hold a particle, or NONE."""
    a, normal = held(world, forces, here, courses, holds, t, x, v)
    for k in range(3):
        if holds[k] != NONE and not normal[k] >= -pull_slack(forces, a):
            return holds[k]
    return NONE


@inlined
def _lift_off(world, forces, here, courses, work, path, end):
    """
    First time on a slide at which a surface would have to pull.

    Returns
    -------
    time : float [s]
        `end` if it never does.
    surface : int
        Which one, or NONE.

    """
    x, v = state_at(world, forces, here, courses, work, path, end)
    s = _pulls(world, forces, here, courses, path.holds, end, x, v)
    low, high = path.since, end
    if s != NONE:
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            x, v = state_at(world, forces, here, courses, work, path, middle)
            other = _pulls(world, forces, here, courses, path.holds, middle, x, v)
            if other == NONE:
                low = middle
            else:
                high, s = middle, other
    return high, s


@inlined
def _regions(world, here, courses, holds, t, x):
    """Give one number for the parts of the shapes that a particle is on."""
    code = 0
    for k in range(3):
        if holds[k] != NONE:
            code = 27 * code + region_of(world, here, courses, holds[k], t, x)
    return code


@inlined
def _region_end(world, forces, here, courses, work, path, end):
    """First time on a slide at which the curvature has jumped; `end` if it does not before."""
    first = _regions(world, here, courses, path.holds, path.since, path.x)
    x, _ = state_at(world, forces, here, courses, work, path, end)
    low, high = path.since, end
    if _regions(world, here, courses, path.holds, end, x) != first:
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            x, _ = state_at(world, forces, here, courses, work, path, middle)
            if _regions(world, here, courses, path.holds, middle, x) == first:
                low = middle
            else:
                high = middle
    return high


@inlined
def _breakaway(world, forces, here, courses, work, path, end):
    """First time at which friction does not hold a resting particle any more, at most `end`."""
    c = path.holds[0] // FACES
    if is_uniform(courses, here, c) and not accelerates(courses, here, c):
        return end
    count = 8 + int(8.0 * quickest(courses, here, c) * (end - path.since))
    low = path.since
    for k in range(count):
        high = path.since + (end - path.since) * (k + 1) / count
        x, _ = state_at(world, forces, here, courses, work, path, high)
        if not can_rest(world, forces, here, courses, path.holds, high, x):
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                if not low < middle < high:
                    break
                x, _ = state_at(world, forces, here, courses, work, path, middle)
                if can_rest(world, forces, here, courses, path.holds, middle, x):
                    low = middle
                else:
                    high = middle
            return high
        low = high
    return end


@inlined
def _face_end(world, forces, here, courses, work, path, end):
    """
    When a particle on a face of a box or cylinder reaches its end.

    Returns
    -------
    time : float [s]
        Infinite if not before `end`.
    collider : int
        Whose face it is, or NONE.

    """
    table = world.table
    first, collider = inf, NONE
    for k in range(3):
        c, face = path.holds[k] // FACES, path.holds[k] % FACES - 1
        if path.mode != SLIDES or path.holds[k] == NONE or face < 0 or table[c, SIDE] < 0.0:
            continue
        for edge in range(faces(table, c, -1.0)):
            if is_end(table, c, face, edge):
                time = first_time(world, forces, here, courses, work, path, c, edge, -1.0, 0.0,
                                  path.since, end, min(end, first))
                if time < first:
                    first, collider = time, c
    return first, collider


@inlined
def _holds(holds, c, face, side):
    """Whether a surface is among some; any face of a solid from outside counts as that solid."""
    for k in range(3):
        if holds[k] == FACES * c + face or (side > 0.0 and holds[k] != NONE
                                            and holds[k] // FACES == c):
            return True
    return False


@inlined
def _whole(table, s):
    """Give the surface by which a particle meets a solid that it was on a face of."""
    return FACES * (s // FACES) if s != NONE and table[s // FACES, SIDE] > 0.0 else s


@inlined
def _first_hit(world, forces, here, courses, work, path, end):
    """
    When a particle comes to a surface that does not hold it; `end` if not before.

    Who rests goes along with the first of the surfaces that hold it; others may come closer.
    """
    table = world.table
    first = end
    for c in range(table.shape[0]):
        side = table[c, SIDE]
        if path.mode == RESTS and c == path.holds[0] // FACES:
            continue
        for face in range(faces(table, c, side)):
            if path.mode == RESTS or not _holds(path.holds, c, face, side):
                first = min(first, first_time(world, forces, here, courses, work, path, c, face,
                                              side, here.radius, path.since, end, first))
    return first


@inlined
def _faces_under(world, here, courses, holds, t, x, v):
    """Give the faces of boxes and cylinders for the surfaces that hold a particle."""
    a, b, c = holds
    a = face_of(world, here, courses, a, t, x, v)
    if b != NONE:
        b = face_of(world, here, courses, b, t, x, v)
    if c != NONE:
        c = face_of(world, here, courses, c, t, x, v)
    return a, b, c


@kernel
def next_event(world, forces, here, courses, work, mode, holds, t, duration, x, v, pace):
    """
    Find the path of a particle from now on, and what ends it.

    Parameters
    ----------
    world, forces, here, courses, work
        As in exact.py.
    mode, holds
        As from sustained.choose_mode.
    t, duration : float [s]
        Now, and the end of the step.
    x, v : (3,) tuple of float [m], [m/s]
        Where and how fast the particle is.
    pace : float [s]
        Guess for a step of the integrator.

    Returns
    -------
    path : Path
    end : float [s]
        When the path ends.
    stopped : int
        Surface on which the particle is then at rest, or NONE.
    released : int
        Surface that lets it go then, or NONE.
    pace : float [s]
        Guess for the next step of the integrator.

    """
    poses = world.poses
    end, stop, stopped, released = duration, inf, NONE, NONE
    if mode == FLIES:
        path = _flight(forces, t, x, v)
    elif mode == RESTS:
        path = Path(RESTS, holds, t, x, v, False, ZERO, 0.0, 0.0, False)
        end = _breakaway(world, forces, here, courses, work, path, end)
    else:
        if at_rest(courses, poses, here, holds[0] // FACES, t, x, v):
            v = material_velocity(courses, poses, here, holds[0] // FACES, t, x)
        holds = _faces_under(world, here, courses, holds, t, x, v)
        path, stop = _straight(world, forces, here, courses, holds, t, x, v)
        if stop <= end:
            end, stopped = stop, holds[0]
    if mode != RESTS and not path.closed:
        end, pace, bend, stiff, stopped = _integrated(world, forces, here, courses, work, path, t,
                                                      duration, pace)
        path = Path(mode, path.holds, t, x, v, False, ZERO, 0.0, bend, stiff)
    last = end
    if mode == SLIDES and not path.closed:
        end = _region_end(world, forces, here, courses, work, path, end)
    edge, left = _face_end(world, forces, here, courses, work, path, end)
    end = _first_hit(world, forces, here, courses, work, path, min(edge, end))
    if mode == SLIDES and not path.closed:
        end, released = _lift_off(world, forces, here, courses, work, path, end)
    if end < last:
        stopped = NONE
    if end == edge and here.radius == 0.0 and stopped == NONE:
        released = FACES * left
    return path, end, stopped, _whole(world.table, released), pace
