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
First time of impact of a particle with a collider along the path of one step.

The particle moves straight by dx, the collider by a constant twist: shift of its position, and a
turn (axis times angle, any number of turns) about it. Times tau run from 0 to 1 over the step. f
is the signed distance less the radius. No hit can be missed, since each way only goes on as far
as a bound on f says that it is positive:

- a shape from outside, not turning: f is convex, so Newton's method from the left stops at or
  before the first root;
- turning: f bends down by less than the acceleration that the turn causes;
- a shape from inside: f is concave along a straight path, so Newton's method from the right finds
  the only way out; when it turns, the path stays within a known distance of its chords.
"""

from math import inf, sqrt

from collision_sim.core.jit import by_address, inlined, kernel
from collision_sim.core.mesh_contact import mesh_hit
from collision_sim.core.modules import MESH_HIT
from collision_sim.core.motion import SHIFT, TURN
from collision_sim.core.shapes import (arm_distance, BOX, CAPSULE, CYLINDER, DISTANCE, KIND, MESH,
                                       PLANE, SIDE, SIZE, SPHERE)
from collision_sim.core.vectors import (add, add_scaled, cross, dot, EPSILON, largest, length,
                                        origin, subtract, turned)

NEVER = 2.0                 # a time of impact after the end of the step
QUERIES = 2000              # most evaluations of f before a query is given up as undecided
TOUCHING = 8.0 * EPSILON    # relative distance at which a particle touches


@inlined
def relative_motion(motion, step, c, dx):
    """
    Give the move of the particle less that of the collider, and the collider's turn.

    Returns
    -------
    move : (3,) tuple of float [m]
    axis : (3,) tuple of float [-]
        Unit, or zero where the collider does not turn.
    angle : float [rad]

    """
    zero = (0.0, 0.0, 0.0)
    shift = (motion[step, c, SHIFT], motion[step, c, SHIFT + 1], motion[step, c, SHIFT + 2])
    turn = (motion[step, c, TURN], motion[step, c, TURN + 1], motion[step, c, TURN + 2])
    angle = length(turn)
    axis = (turn[0] / angle, turn[1] / angle, turn[2] / angle) if angle > 0.0 else zero
    return subtract(dx, shift), axis, angle


@kernel
def path_distance(present, table, poses, row, c, radius, arm, move, axis, angle, tau):
    """
    Signed distance on the path, how it changes, and the normal, at a time of the step.

    Parameters
    ----------
    present, table, poses, row, c, radius
        As in `first_hit`.
    arm : (3,) tuple of float [m]
        Particle less position of the collider at the start of the step.
    move, axis, angle
        As from `relative_motion`.
    tau : float [-]
        From 0 to 1.

    Returns
    -------
    f, slope : float [m]
        Signed distance less radius, and its derivative by tau.
    n : (3,) tuple of float [-]

    """
    now = add_scaled(arm, tau, move)
    if angle == 0.0:
        phi, n = arm_distance(present, table, poses, row, c, now)
        return phi - radius, dot(n, move), n
    phi, n = arm_distance(present, table, poses, row, c, turned(axis, -angle * tau, now))
    n = turned(axis, angle * tau, n)
    return phi - radius, dot(n, add_scaled(move, -angle, cross(axis, now))), n


@inlined
def safe_step(f, slope, bend, touching):
    """Time for which f stays above -touching where it bends down by at most `bend`."""
    above = max(f + touching, 0.0)
    if bend > 0.0:
        root = sqrt(slope * slope + 2.0 * bend * above)
        if slope < 0.0:     # no difference of what is alike: a turn may be as small as rounding
            return 2.0 * above / (root - slope)
        return (slope + root) / bend
    return NEVER if slope >= 0.0 else above / -slope


@kernel
def _face_step(table, poses, row, c, radius, arm, move, axis, angle, reach, touching, tau):
    """
    Time for which the particle stays beyond one and the same face of a turning shape.

    The distance to the plane of a face is never more than that to the shape, and it bends only by
    the part of the face's normal that turns: not at all on top of a turntable.
    """
    step, kind = 0.0, table[c, KIND]
    now = turned(axis, -angle * tau, add_scaled(arm, tau, move))
    back = turned(axis, -angle * tau, move)
    for k in range(0 if kind == BOX else 2, 3 if kind != CAPSULE else 0):
        e = (poses[row, c, k], poses[row, c, 3 + k], poses[row, c, 6 + k])
        half = 0.0 if kind == PLANE else table[c, SIZE + (1 if kind == CYLINDER else k)]
        z = dot(e, now)
        side = -1.0 if z < 0.0 and kind != PLANE else 1.0
        across = cross(axis, e)
        slope = side * (dot(e, back) + angle * dot(across, now))
        bend = length(across) * angle * (2.0 * length(move) + angle * reach)
        if side * z - half - radius >= -touching:
            step = max(step, safe_step(side * z - half - radius, slope, bend, touching))
    return step


@inlined
def _from_outside(present, table, poses, row, c, radius, arm, move, axis, angle, reach, touching):
    """First hit of a convex shape from outside: tau, normal, and whether it was decided."""
    speed = length(move) + angle * reach
    bend = angle * (2.0 * speed + angle * reach)
    tau = 0.0
    for _ in range(QUERIES):
        f, slope, n = path_distance(present, table, poses, row, c, radius, arm, move, axis, angle,
                                    tau)
        h = safe_step(f, slope, bend, touching if angle == 0.0 else 0.0)
        if angle > 0.0:
            h = max(h, max(f, touching) / speed)
            h = max(h, _face_step(table, poses, row, c, radius, arm, move, axis, angle, reach,
                                  touching, tau))
        if tau + h >= 1.0:
            return NEVER, n, True
        if f <= touching and slope < 0.0:
            return tau, n, True
        tau += h if angle > 0.0 else max(f, 0.0) / -slope
    return tau, n, False


@kernel
def _way_out(present, table, poses, row, c, radius, arm, move, touching):
    """Only way out of a convex shape that does not turn, as `_from_outside`."""
    zero, tau = (0.0, 0.0, 0.0), 0.0
    f, slope, n = path_distance(present, table, poses, row, c, radius, arm, move, zero, 0.0, 0.0)
    end, _, _ = path_distance(present, table, poses, row, c, radius, arm, move, zero, 0.0, 1.0)
    if f <= touching and slope < 0.0 and end < -touching:
        return 0.0, n, True
    tau = 1.0
    for _ in range(QUERIES):
        f, slope, n = path_distance(present, table, poses, row, c, radius, arm, move, zero, 0.0,
                                    tau)
        if f >= -touching or slope >= 0.0:
            return (NEVER if tau == 1.0 else tau), n, True
        tau = max(tau - f / slope, 0.0)
    return tau, n, False


@kernel
def _turning_way_out(present, table, poses, row, c, radius, arm, move, axis, angle, reach,
                     touching):
    """First way out of a convex shape that turns, as `_from_outside`."""
    speed = length(move) + angle * reach
    bend = angle * (2.0 * speed + angle * reach)
    tau, h = 0.0, 1.0
    fa, slope, n = path_distance(present, table, poses, row, c, radius, arm, move, axis, angle,
                                 0.0)
    if fa <= touching and slope < 0.0:
        return 0.0, n, True
    for _ in range(QUERIES):
        later = min(tau + h, 1.0)
        fb, slope, n = path_distance(present, table, poses, row, c, radius, arm, move, axis, angle,
                                     later)
        sag = 0.125 * bend * (later - tau) ** 2
        if min(fa, fb) + touching >= sag:
            if later == 1.0:
                return NEVER, n, True
            tau, fa, h = later, fb, 2.0 * h
        elif fb < 0.0 and (fb >= -touching or h * speed <= touching):
            return later, n, True
        else:
            h *= 0.5
    return tau, n, False


@inlined
def _turns_in_itself(table, poses, row, c, axis):
    """Whether a shape of revolution, or a plane, turns about its own axis."""
    if table[c, KIND] == BOX or table[c, KIND] == MESH:
        return False
    z = (poses[row, c, 2], poses[row, c, 5], poses[row, c, 8])
    return largest(cross(axis, z)) <= TOUCHING


@inlined
def _hits_mesh(present, table, poses, row, c, radius, arm, move, axis, angle):
    """Whether a collider is a mesh, and the time and the normal of the first hit then."""
    if table[c, KIND] == MESH:
        tau, n = by_address(present.modules, MESH_HIT, mesh_hit, DISTANCE,
                            (present.meshes, table, poses, row, c, radius, arm, move, axis, angle))
        return True, tau, n
    return False, NEVER, (0.0, 0.0, 1.0)


@inlined
def touching_distance(table, poses, row, c, radius, x0):
    """Distance [m] at which a particle touches a collider, of the order of rounding."""
    return TOUCHING * (largest(x0) + largest(origin(poses, row, c)) + table[c, SIZE] + radius)


@kernel
def only_grazes(present, table, poses, motion, step, row, c, radius, x0, dx, tau):
    """
    Whether a particle that hits an edge or a cap at time tau comes no deeper than touching it.

    It goes level over flush tiles then, or along a row of rods. From outside the distance is
    convex along a straight way. For a collider that turns, and for other shapes, it is no.
    """
    kind = table[c, KIND]
    if table[c, SIDE] < 0.0 or (kind != BOX and kind != CYLINDER and kind != CAPSULE):
        return False
    move, axis, angle = relative_motion(motion, step, c, dx)
    touching, arm = touching_distance(table, poses, row, c, radius, x0), subtract(
        x0, origin(poses, row, c))
    early, late = tau, 1.0
    f, slope, _ = path_distance(present, table, poses, row, c, radius, arm, move, axis, angle, 1.0)
    if angle > 0.0 or f < -touching:
        return False
    while slope > 0.0 and late - early > EPSILON:
        middle = 0.5 * (early + late)
        f, rise, _ = path_distance(present, table, poses, row, c, radius, arm, move, axis, angle,
                                   middle)
        if f < -touching:
            return False
        early, late = (early, middle) if rise > 0.0 else (middle, late)
    return True


@inlined
def first_hit(present, table, poses, motion, step, row, c, radius, x0, dx):
    """
    First time at which a particle on its path hits a collider that it starts outside of.

    Parameters
    ----------
    present, table, poses
        As in shapes.signed_distance.
    motion : (S, C, MOTION) float64
        How the colliders move in each step.
    step, row, c : int
        Row of motion, row of poses at the start of the step, collider.
    radius : float [m]
        Of the particle.
    x0, dx : (3,) tuple of float [m]
        Start of the path and its length.

    Returns
    -------
    tau : float [-]
        From 0 to 1, or NEVER. A particle that touches at the start hits at 0 if it approaches.
    n : (3,) tuple of float [-]
        Normal at the hit.
    arm : (3,) tuple of float [m]
        Particle less position of the collider at the hit.
    decided : bool
        False where QUERIES ran out; tau is then the time that was reached.

    """
    move, axis, angle = relative_motion(motion, step, c, dx)
    if table[c, KIND] == SPHERE or _turns_in_itself(table, poses, row, c, axis):
        angle = 0.0
    arm = subtract(x0, origin(poses, row, c))
    reach = max(length(arm), length(add_scaled(arm, 1.0, move)))
    is_mesh, tau, n = _hits_mesh(present, table, poses, row, c, radius, arm, move, axis, angle)
    if is_mesh:
        return tau, n, add_scaled(arm, tau, move), True
    touching = touching_distance(table, poses, row, c, radius, x0)
    if table[c, SIDE] > 0.0:
        tau, n, decided = _from_outside(present, table, poses, row, c, radius, arm, move, axis,
                                        angle, reach, touching)
    elif angle == 0.0:
        tau, n, decided = _way_out(present, table, poses, row, c, radius, arm, move, touching)
    else:
        tau, n, decided = _turning_way_out(present, table, poses, row, c, radius, arm, move, axis,
                                           angle, reach, touching)
    return tau, n, add_scaled(arm, tau, move), decided


@inlined
def path_velocity(motion, step, c, arm, dt):
    """Velocity [m/s] of the material point at `arm` from the collider's position, on the path."""
    shift = (motion[step, c, SHIFT], motion[step, c, SHIFT + 1], motion[step, c, SHIFT + 2])
    turn = (motion[step, c, TURN], motion[step, c, TURN + 1], motion[step, c, TURN + 2])
    v = add(shift, cross(turn, arm))
    return (v[0] / dt, v[1] / dt, v[2] / dt)


@kernel
def sweep_margin(sweep, motion, step, table, c):
    """
    Bound on how far the surface of a collider comes in a step [m]; 0 without `sweep`.

    A plane that turns has no bound: infinity.
    """
    if sweep:
        zero = (0.0, 0.0, 0.0)
        move, _, angle = relative_motion(motion, step, c, zero)
        size = (table[c, SIZE], table[c, SIZE + 1], table[c, SIZE + 2])
        extent = inf if table[c, KIND] == PLANE else size[0] + size[1] + size[2]
        return length(move) + (min(angle, 2.0) * extent if angle > 0.0 else 0.0)
    return 0.0
