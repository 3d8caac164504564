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
Which collider a particle has to answer next: by where the step ends, or by the path it takes.

A particle starts the step at x0 with velocity v0, moves with the mean velocity u to x1 and is
tested against the poses at the END of the step (`survey`) or against all poses on the way
(`survey_path`). What was only reached by rounding does not count.
"""

from collision_sim.core.broad_phase import how_many, nth
from collision_sim.core.faces import (crossed_face, face_below, face_towards, goes_through,
                                      height_over, is_covered, nearest_face)
from collision_sim.core.jit import by_address, inlined, kernel
from collision_sim.core.laws import repulsion
from collision_sim.core.mesh_contact import depth_at, hit_on_way, mesh_end, mesh_gap
from collision_sim.core.modules import (BLOCKER, MEETING_ON_PATH, MESH_DEPTH, MESH_END, MESH_GAP,
                                        MESH_WAY, NORMAL_BETWEEN, SURVEY_PATH)
from collision_sim.core.motion import chord_velocity, point_velocity, START
from collision_sim.core.rules import (N_UNDECIDED, NONE, NOTHING, PARALLEL, ROUNDING, SAME_SIDE,
                                      STRAIGHT, Touch)
from collision_sim.core.shapes import (BOX, DISTANCE, has_faces, KIND, MESH, RESTITUTION,
                                       seam_width, signed_distance, SIZE)
from collision_sim.core.ties import (ALIKE, is_before, lacks_alike, SAME_TIME, stands_first,
                                     to_units)
from collision_sim.core.trajectory import (first_hit, NEVER, only_grazes, path_velocity,
                                           relative_motion)
from collision_sim.core.vectors import (add, add_scaled, dot, largest, length, origin, rotate_back,
                                        scaled, subtract, turned)

ENOUGH = 1e-6           # share of the speed of a repulsion that may lack


@kernel
def distance(world, here, row, c, point):
    """Signed distance [m] of the particle to a collider, with a row of poses."""
    rules, table, poses = world.rules, world.table, world.poses
    return signed_distance(rules.present, table, poses, row, c, point)[0] - here.radius


@kernel
def _end_at_mesh(world, here, c, x0, x1):
    rules, table, poses = world.rules, world.table, world.poses
    return by_address(rules.present.modules, MESH_END, mesh_end, DISTANCE,
                      (rules.present.meshes, here.answers, table, poses, here.start, here.end, c,
                       here.radius, x0, x1))


@inlined
def end_distance(world, here, c, x0, x1):
    """
    Signed distance [m] of the particle to a collider at the end of the step, and the normal there.

    Of a box or a cylinder that its centre ends inside of, they are those of the answering face
    (faces.py). A mesh is met on the way there, too: it can be thinner than a step, and an open one
    has no inside at all.
    """
    table, poses = world.table, world.poses
    if table[c, KIND] == MESH:
        return _end_at_mesh(world, here, c, x0, x1)
    phi, n = signed_distance(world.rules.present, table, poses, here.end, c, x1)
    if has_faces(table, c) and phi < seam_width(table, c, origin(poses, here.end, c)):
        return _end_in_faces(world, here, c, x0, x1)
    return phi - here.radius, n


@inlined
def end_gap(world, here, c, reach, x0, x1):
    """Give what `end_distance` does, with the gap to a mesh that the particle stays clear of."""
    rules, table, poses = world.rules, world.table, world.poses
    gap, n = end_distance(world, here, c, x0, x1)
    present = rules.present
    if table[c, KIND] == MESH and not gap < 0.0:
        return by_address(present.modules, MESH_GAP, mesh_gap, DISTANCE,
                          (present.meshes, table, poses, here.start, here.end, c, here.radius,
                           reach, x1))
    return gap, n


@kernel
def _end_in_faces(world, here, c, x0, x1):
    """Height and normal as `end_distance`, of a particle whose centre ends inside faces."""
    rounding = rounding_depth(world, here, c, x0)
    if _depth_in_faces(world, here, c, x0) > rounding:
        return nearest_face(world, here, here.end, c, x1)
    height, n, _ = crossed_face(world, here, c, x0, x1)
    return height, n


@kernel
def _depth_in_faces(world, here, c, x0):
    """Depth [m] in a box or a cylinder at the start of the step, below a face that is no seam."""
    table, poses = world.table, world.poses
    gap = signed_distance(world.rules.present, table, poses, here.start, c, x0)[0]
    if gap < seam_width(table, c, origin(poses, here.start, c)):
        return -nearest_face(world, here, here.start, c, x0)[0]
    return here.radius - gap


@inlined
def path_hit(world, here, c, x0, x1):
    """
    First hit on the path as trajectory.first_hit; of a mesh that does not turn, on the way.

    A box or a cylinder that is hit where another collider covers it is not, but for a face that
    is crossed and open (faces.py).
    """
    rules, table, poses, motion = world.rules, world.table, world.poses, world.motion
    dx = subtract(x1, x0)
    move, axis, angle = relative_motion(motion, here.step, c, dx)
    start = subtract(x0, origin(poses, here.start, c))
    present = rules.present
    if table[c, KIND] == MESH and angle == 0.0:
        tau, n = by_address(present.modules, MESH_WAY, hit_on_way, DISTANCE,
                            (present.meshes, here.answers, table, poses, here.start, here.end, c,
                             here.radius, x0, x1))
        return tau, n, add_scaled(start, tau, move), True
    tau, n, arm, decided = first_hit(rules.present, table, poses, motion, here.step, here.start, c,
                                     here.radius, x0, dx)
    if tau <= 1.0:
        covered, later, n_later = _hit_when_covered(world, here, c, x0, x1, tau, n, arm, axis,
                                                    angle)
        if covered:
            return later, n_later, add_scaled(start, later, move), decided
    if tau <= 1.0 and only_grazes(rules.present, table, poses, motion, here.step, here.start, c,
                                  here.radius, x0, dx, tau):
        tau = NEVER
    return tau, n, arm, decided


@inlined
def _hit_when_covered(world, here, c, x0, x1, tau, n, arm, axis, angle):
    """Whether a face is covered where it is hit, and the time and the normal of the hit then."""
    table, poses = world.table, world.poses
    if has_faces(table, c):
        q = rotate_back(poses, here.start, c, turned(axis, -angle * tau, arm))
        m = rotate_back(poses, here.start, c, turned(axis, -angle * tau, n))
        face = face_towards(table, c, m)
        if is_covered(world, here, c, face, q, tau, x0, False, False) and (
                not goes_through(world, here, c, face, x0, x1)):
            later, n_later = _hit_on_open_face(world, here, c, x0, x1)
            return True, later, n_later
    return False, tau, n


@kernel
def _hit_on_open_face(world, here, c, x0, x1):
    """Time and normal at which a face is crossed that answers at the end; NEVER if none does."""
    table, poses = world.table, world.poses
    gap, n = signed_distance(world.rules.present, table, poses, here.end, c, x1)
    if gap < seam_width(table, c, origin(poses, here.end, c)):
        height, n, tau = crossed_face(world, here, c, x0, x1)
        if height < 0.0:
            return tau, n
    return NEVER, n


@kernel
def _depth_in_mesh(world, here, c, x0):
    rules = world.rules
    return by_address(rules.present.modules, MESH_DEPTH, depth_at, NEVER,
                      (rules.present.meshes, here.answers, world.table, world.poses, here.start, c,
                       here.radius, x0))


@inlined
def _start_depth(world, here, c, x0):
    """Depth [m] of the particle in a collider at the start of the step; negative outside."""
    table = world.table
    if table[c, KIND] == MESH:
        return _depth_in_mesh(world, here, c, x0)
    if has_faces(table, c):
        return _depth_in_faces(world, here, c, x0)
    return -distance(world, here, here.start, c, x0)


@inlined
def is_same_surface(table, c, n, other, n_other):
    """Whether two contacts are with one surface: the same collider, of a mesh the same face."""
    if table[c, KIND] == MESH:
        return c == other and dot(n, n_other) > STRAIGHT
    return c == other


@inlined
def rounding_depth(world, here, c, x0):
    """Distance [m] to a collider at the start of the step that is only rounding."""
    table, poses = world.table, world.poses
    return ROUNDING * (largest(x0) + largest(origin(poses, here.start, c)) + table[c, SIZE])


@inlined
def starts_inside(world, here, c, x0):
    """Depth [m] at which the particle starts the step inside a collider; 0 if only by rounding."""
    depth = _start_depth(world, here, c, x0)
    return depth if depth > rounding_depth(world, here, c, x0) else 0.0


@kernel
def deepest(world, here, x0, x1):
    """
    Collider in which the particle ends deepest, of those it started outside of.

    Parameters
    ----------
    world, here
        As in `resolve`.
    x0, x1 : (3,) tuple of float [m]
        Start and end of the step.

    Returns
    -------
    c : int
        NONE if it ends outside all; equally deep: ties.stands_first.
    phi : float [m]
        Signed distance, negative.
    n : (3,) tuple of float [-]

    """
    c, phi, n, blur = NONE, 0.0, (0.0, 0.0, 1.0), 0.0
    for m in range(here.chosen.shape[0]):
        k = here.chosen[m]
        phi_k, n_k = end_distance(world, here, k, x0, x1)
        if phi_k < 0.0:
            rounding = rounding_depth(world, here, k, x0)
            first = phi_k < phi
            if c != NONE and abs(phi_k - phi) <= rounding + blur:
                first = stands_first(world.table, world.poses, here.end, k, n_k, c, n)
            if first and starts_inside(world, here, k, x0) == 0.0:
                c, phi, n, blur = k, phi_k, n_k, rounding
    return c, phi, n


@inlined
def approach(v, obj, n):
    """Give the normal velocity [m/s] if it approaches by more than rounding, else 0."""
    v_n = dot(subtract(v, obj), n)
    return v_n if v_n < -ROUNDING * (largest(v) + largest(obj)) else 0.0


@inlined
def _rounding_speed(world, here, c, x0, v0, u, obj):
    """
    Give the normal velocity [m/s] at the start that is only rounding, with second order.

    It is left over from larger velocities, and from a normal that is rounded where a small shape
    is far from the origin; a particle that slides there would else collide in every step.
    """
    if world.rules.second:
        size = world.table[c, SIZE]
        blur = rounding_depth(world, here, c, x0) / size if size > 0.0 else 0.0
        return (ROUNDING + blur) * (largest(v0) + largest(u) + largest(obj))
    return 0.0


@inlined
def start_approach(checks, v0, obj, n, rounding):
    """Give the normal velocity of a collision on v0; 0 without that stage."""
    if checks:
        v_n = approach(v0, obj, n)
        return v_n if v_n < -rounding else 0.0
    return 0.0


@inlined
def mean_approach(rules, depth, n, obj, u):
    """
    Give the normal velocity of u, and the one to reach: 0, or the speed of repulsion.

    A repulsion that lacks ENOUGH of its speed is answered no more. That the normal turns on the
    way, or another collider pushes too, would else take pass after pass, until rounding ends it.
    """
    if depth > 0.0:
        target = repulsion(depth, rules.flight.dt, rules.share, rules.highest)
        v_n = dot(subtract(u, obj), n)
        blur = max(ENOUGH * target, ROUNDING * (largest(u) + largest(obj)))
        return (v_n if v_n < target - blur else target), target
    return approach(u, obj, n), 0.0


@inlined
def contact_normal(world, here, c, x0, x1, depth, phi, n):
    """
    Return the normal to act along: the one given, at the end, but with contacts of second order.

    Returns
    -------
    n : (3,) tuple of float [-]
    stays, touches : bool
        As of `normal_between`.

    """
    if world.rules.second and depth == 0.0:
        return _known_normal(world, here, c, x0, x1, phi, n)
    return n, False, False


@kernel
def _known_normal(world, here, c, x0, x1, phi, n):
    rules = world.rules
    return by_address(rules.present.modules, NORMAL_BETWEEN, normal_between, (n, False, False),
                      (world, here, c, x0, x1, phi, n))


@kernel
def normal_between(world, here, c, x0, x1, phi, n):
    """
    Return the normal to act along with contacts of second order, where that is known.

    A particle that starts outside and ends inside on the same side meets the surface in between,
    where the distance is 0: the normals at both ends are interpolated, those of the face that it
    ends behind. A particle that touches at the start meets the surface there.

    Returns
    -------
    n : (3,) tuple of float [-]
    stays, touches : bool
        Whether n is such a normal, else it is the one given, at the end; and whether the particle
        touches at the start.

    """
    table, poses = world.table, world.poses
    gap, start = signed_distance(world.rules.present, table, poses, here.start, c, x0)
    gap -= here.radius
    rounding = rounding_depth(world, here, c, x0)
    touches = gap <= rounding
    face = face_below(table, poses, here.end, c, x1, n)
    if face != NONE and (touches or dot(start, n) > STRAIGHT):
        height, over = height_over(table, poses, here.start, c, face, x0)
        if not touches or height - here.radius >= -rounding:    # and no other face
            start, gap = over, max(height - here.radius, 0.0)
    cosine = dot(start, n)
    if touches:
        return (start if cosine > SAME_SIDE else n), cosine > SAME_SIDE, True
    if phi < 0.0 and cosine > STRAIGHT:
        between = add_scaled(start, gap / (gap - phi), subtract(n, start))
        return scaled(1.0 / length(between), between), True, False
    return n, False, False


@inlined
def _acts(world, here, c, x1, phi, stays, v_n, target):
    """
    Whether the contact stage has to act: on an approach, or a separation that is too slow.

    A contact of second order is done with once the particle is on the surface, to rounding: the
    mean velocity along a curved surface approaches it, or leaves it, in between.
    """
    rules, table, poses = world.rules, world.table, world.poses
    if stays:
        limit = ROUNDING * (largest(x1) + largest(origin(poses, here.end, c)) + table[c, SIZE])
        return phi < -(limit if v_n == 0.0 else min(limit, -0.5 * rules.flight.dt * v_n))
    return v_n < target


@kernel
def _is_left(world, here, press, touch, x0, x1):
    """
    Whether a collider is not met any more once a particle is pressed against another.

    Without contact forces a candidate sinks a little into what it slides on. There it may meet an
    edge of the next tile, or the end of the next rod in a row, that it does not meet in truth.
    """
    k = touch.collider
    if press.collider == k:
        return False
    pressed = add_scaled(x1, world.rules.flight.dt * (press.target - press.v_n), press.normal)
    before, _ = end_distance(world, here, k, x0, x1)
    phi, _ = end_distance(world, here, k, x0, pressed)
    return phi >= max(-rounding_depth(world, here, k, x0), 0.5 * before)


@kernel
def _is_left_on_path(world, here, press, touch, x0, x1, v0):
    """Whether a collider is not met any more on the path to where `_is_left` looks."""
    k = touch.collider
    if press.collider == k:
        return False
    pressed = add_scaled(x1, world.rules.flight.dt * (press.target - press.v_n), press.normal)
    tau, n, _, _ = path_hit(world, here, k, x0, pressed)
    return tau > 1.0 or dot(subtract(v0, touch.obj), n) > 0.5 * touch.v_n


@inlined
def _collision_at(world, here, k, x0, x1, v0, u, phi, n, stays):
    """Return the Touch of a collision with v0 where the step ends, NOTHING without approach."""
    obj = point_velocity(world.motion, world.poses, here.step, START, here.start, k, x0)
    v_n = start_approach(world.rules.checks, v0, obj, n,
                         _rounding_speed(world, here, k, x0, v0, u, obj))
    if v_n < 0.0:
        return Touch(k, n, obj, add_scaled(x1, -phi, n), v_n, 0.0, True, stays)
    return NOTHING


@inlined
def _press_at(world, here, k, x0, x1, u, depth, phi, n, stays):
    """Return the Touch of a contact where the step ends, NOTHING where there is none to act on."""
    rules = world.rules
    obj = chord_velocity(world.motion, world.poses, here.step, here.start, k, x0, rules.flight.dt)
    v_n, target = mean_approach(rules, depth, n, obj, u)
    if _acts(world, here, k, x1, phi, stays, v_n, target):
        return Touch(k, n, obj, add_scaled(x1, -phi, n), v_n, target, False, stays)
    return NOTHING


@inlined
def survey(world, here, x0, x1, v0, u, collides):
    """
    Find the collider to act on next, of those that the particle ends inside of: the deepest.

    `collides` says whether the collision stage is still on. A collider approached with v0 then
    comes before those that are only approached with u, or not left fast enough, unless it is left
    as these are answered.

    Returns
    -------
    touch : Touch
    inside : int
        0 where the particle ends outside of all colliders, 1 inside of any; 2 where it may be as
        deep in others (`foremost`).

    """
    hit, press, deep, phi, inside = NOTHING, NOTHING, 0.0, 0.0, 0
    hit_blur, press_blur, hit_near, press_near = 0.0, 0.0, False, False
    for m in range(how_many(here)):
        k = nth(here, m)
        phi_k, n = end_distance(world, here, k, x0, x1)
        if phi_k >= 0.0:
            continue
        inside, collision = 1, NOTHING
        blur = rounding_depth(world, here, k, x0)
        depth = starts_inside(world, here, k, x0)
        n, stays, _ = contact_normal(world, here, k, x0, x1, depth, phi_k, n)
        if collides and depth == 0.0:
            collision = _collision_at(world, here, k, x0, x1, v0, u, phi_k, n, stays)
        if collision.hit:
            hit_near = hit_near or (hit.hit and abs(phi_k - deep) <= blur + hit_blur)
            if phi_k < deep:
                hit, deep, hit_blur = collision, phi_k, blur
        elif phi_k <= phi + blur + press_blur:
            touch = _press_at(world, here, k, x0, x1, u, depth, phi_k, n, stays)
            if touch.collider != NONE:
                press_near = press_near or (press.collider != NONE
                                            and abs(phi_k - phi) <= blur + press_blur)
                if phi_k < phi:
                    press, phi, press_blur = touch, phi_k, blur
    if hit.hit and press.collider != NONE:
        hit, hit_near = _deepest_hit(world, here, press, x0, x1, v0, u), False
    if hit.hit:
        return hit, inside + hit_near
    return press, inside + press_near


@kernel
def _deepest_hit(world, here, press, x0, x1, v0, u):
    """Find the collision to act on as `survey`, of those that are not left; NOTHING for none."""
    hit, deep, hit_blur = NOTHING, 0.0, 0.0
    for m in range(how_many(here)):
        k = nth(here, m)
        phi, n = end_distance(world, here, k, x0, x1)
        blur = rounding_depth(world, here, k, x0)
        if phi < 0.0 and phi <= deep + blur + hit_blur and starts_inside(world, here, k,
                                                                         x0) == 0.0:
            n, stays, _ = contact_normal(world, here, k, x0, x1, 0.0, phi, n)
            collision = _collision_at(world, here, k, x0, x1, v0, u, phi, n, stays)
            first = phi < deep
            if hit.hit and abs(phi - deep) <= blur + hit_blur:
                first = is_before(world.table, world.poses, here.end, collision, hit, v0)
            if collision.hit and first and not _is_left(world, here, press, collision, x0, x1):
                hit, deep, hit_blur = collision, phi, blur
    return hit


@inlined
def _only_bulges(world, here, k, phi, x0, v0, u, n_end):
    """
    Whether a particle that ends outside meets a surface on the chord of its path only.

    Just after it has let go of a curved surface, the chord of a step cuts the surface, the path
    does not; to act on that would make lift-off an error of first order. Such a cut is no steeper
    than half the turn of the normal.
    """
    rules, table, poses, motion = world.rules, world.table, world.poses, world.motion
    if rules.second:
        _, _, angle = relative_motion(motion, here.step, k, x0)
        if phi >= 0.0 and table[k, KIND] != BOX and angle <= STRAIGHT:
            n = signed_distance(rules.present, table, poses, here.start, k, x0)[1]
            obj = point_velocity(motion, poses, here.step, START, here.start, k, x0)
            steepest = 0.5 * length(subtract(n_end, n)) * length(subtract(u, obj))
            return dot(n, n_end) > STRAIGHT and dot(subtract(v0, obj), n) >= -steepest
    return False


@inlined
def _hit_along_seam(world, here, k, x0, x1, tau, n):
    """Time and normal of the hit of a particle that goes down along a seam."""
    if has_faces(world.table, k):
        return _hit_on_open_face(world, here, k, x0, x1)
    return tau, n


@inlined
def _impact(world, here, k, depth, x0, x1, v0, u):
    """
    Time, normal and arm of the impact with a collider on the path of the step.

    And whether that normal is known for contacts of second order (`contact_normal`), and the
    distance at the end.

    Where the particle touches at the start, and ends inside on the same side, the normal is that
    at the end, as without sweeps: on curved surfaces the normal at the start would let a slide
    gain energy. The face that it touches is taken to go on beyond its edges. A collider that it
    started inside of counts as hit at the start if it ends inside.
    """
    table, poses = world.table, world.poses
    phi, n_end = end_distance(world, here, k, x0, x1)
    arm = subtract(x0, origin(poses, here.start, k))
    if depth > 0.0:
        return (0.0 if phi < 0.0 else NEVER), n_end, arm, False, phi
    n, stays, touches = contact_normal(world, here, k, x0, x1, depth, phi, n_end)
    if stays and touches:
        face = face_below(table, poses, here.start, k, x0, n)
        if face != NONE:
            phi = min(phi, height_over(table, poses, here.end, k, face, x1)[0] - here.radius)
        obj = point_velocity(world.motion, poses, here.step, START, here.start, k, x0)
        least = _rounding_speed(world, here, k, x0, v0, u, obj)
        if phi < 0.0 or start_approach(True, v0, obj, n, least) == 0.0:
            return (0.0 if phi < 0.0 else NEVER), n, arm, True, phi
    if _only_bulges(world, here, k, phi, x0, v0, u, n_end):
        return NEVER, n_end, arm, False, phi
    tau, n, arm, decided = path_hit(world, here, k, x0, x1)
    if tau > 1.0 and phi < 0.0:
        tau, n = _hit_along_seam(world, here, k, x0, x1, tau, n)
    world.accounts[here.block, N_UNDECIDED] += not decided
    if tau == 0.0 and phi < 0.0 and dot(n, n_end) > SAME_SIDE:
        face = face_below(table, poses, here.start, k, x0, n)
        n = n_end if face == NONE else height_over(table, poses, here.end, k, face, x1)[1]
    return tau, n, arm, stays and phi < 0.0, phi


@inlined
def _collision_on_path(world, here, k, x0, x1, v0, u, tau, n, arm, stays):
    """Return the Touch of a collision with v0 at time tau, NOTHING without approach."""
    rules, motion = world.rules, world.motion
    obj = path_velocity(motion, here.step, k, arm, rules.flight.dt)
    if tau == 0.0:
        obj = point_velocity(motion, world.poses, here.step, START, here.start, k, x0)
    v_n = start_approach(rules.checks, v0, obj, n,
                         _rounding_speed(world, here, k, x0, v0, u, obj))
    if v_n < 0.0:
        point = add_scaled(x0, tau, subtract(x1, x0))
        return Touch(k, n, obj, point, v_n, 0.0, True, stays)
    return NOTHING


@inlined
def _press_on_path(world, here, k, x0, x1, u, depth, tau, phi, n, arm, stays):
    """Return the Touch of a contact at time tau, NOTHING where there is none to act on."""
    rules, motion = world.rules, world.motion
    dt = rules.flight.dt
    obj = chord_velocity(motion, world.poses, here.step, here.start, k, x0, dt)
    v_n, target = mean_approach(rules, depth, n, obj, u)
    if v_n >= target and depth == 0.0 and not stays:
        obj = path_velocity(motion, here.step, k, arm, dt)
        v_n = approach(u, obj, n)
    if _acts(world, here, k, x1, phi, stays, v_n, target):
        point = add_scaled(x0, tau, subtract(x1, x0))
        return Touch(k, n, obj, point, v_n, target, False, stays)
    return NOTHING


@kernel
def survey_path(world, here, x0, x1, v0, u, collides):
    """
    Find the collider to act on next, of those that the particle hits on its path: the earliest.

    As `survey`, with the normal at the hit; the material velocity there where the particle hits on
    its way, that of `survey` where it touches from the start. Of those hit at the same time, which
    are all that it touches from the start, the one that it ends deepest in comes first.
    """
    hit, press, hit_time, press_time = NOTHING, NOTHING, NEVER, NEVER
    deep, deepest_press, hit_blur, press_blur, inside = 0.0, 0.0, 0.0, 0.0, 0
    hit_near, press_near = False, False
    for m in range(how_many(here)):
        k = nth(here, m)
        depth = starts_inside(world, here, k, x0)
        tau, n, arm, stays, phi = _impact(world, here, k, depth, x0, x1, v0, u)
        if tau > 1.0:
            continue
        inside, collision = 1, NOTHING
        blur = rounding_depth(world, here, k, x0)
        if collides and depth == 0.0:
            collision = _collision_on_path(world, here, k, x0, x1, v0, u, tau, n, arm, stays)
        if collision.hit:
            hit_near = hit_near or (hit.hit and abs(tau - hit_time) <= SAME_TIME
                                    and abs(phi - deep) <= blur + hit_blur)
            if tau < hit_time or (tau == hit_time and phi < deep):
                hit, hit_time, deep, hit_blur = collision, tau, phi, blur
        elif tau <= press_time + SAME_TIME:
            touch = _press_on_path(world, here, k, x0, x1, u, depth, tau, phi, n, arm, stays)
            if touch.collider != NONE:
                press_near = press_near or (
                    press.collider != NONE and abs(tau - press_time) <= SAME_TIME
                    and abs(phi - deepest_press) <= blur + press_blur)
                if tau < press_time or (tau == press_time and phi < deepest_press):
                    press, press_time, deepest_press, press_blur = touch, tau, phi, blur
    if hit.hit and press.collider != NONE and press_time <= hit_time:
        hit, hit_near = _first_hit_on_path(world, here, press, x0, x1, v0, u), False
    if hit.hit:
        return hit, inside + hit_near
    return press, inside + press_near


@kernel
def _first_hit_on_path(world, here, press, x0, x1, v0, u):
    """Find the collision to act on as `survey_path`, of those not left; NOTHING for none."""
    hit, first, deep, hit_blur = NOTHING, NEVER, 0.0, 0.0
    for m in range(how_many(here)):
        k = nth(here, m)
        if starts_inside(world, here, k, x0) > 0.0:
            continue
        tau, n, arm, stays, phi = _impact(world, here, k, 0.0, x0, x1, v0, u)
        if tau <= 1.0 and tau <= first + SAME_TIME:
            blur = rounding_depth(world, here, k, x0)
            collision = _collision_on_path(world, here, k, x0, x1, v0, u, tau, n, arm, stays)
            earlier = tau < first or (tau == first and phi < deep)
            if hit.hit and abs(tau - first) <= SAME_TIME and abs(phi - deep) <= blur + hit_blur:
                earlier = is_before(world.table, world.poses, here.end, collision, hit, v0)
            if collision.hit and earlier and not _is_left_on_path(world, here, press, collision,
                                                                  x0, x1, v0):
                hit, first, deep, hit_blur = collision, tau, phi, blur
    return hit


@kernel
def meeting_on_path(world, here, k, depth, x0, x1, v0, u, hit):
    """Touch of a collider as `_meeting`, on the path of a particle that starts that deep in it."""
    tau, n, arm, stays, phi = _impact(world, here, k, depth, x0, x1, v0, u)
    if tau > 1.0 or (hit and depth > 0.0):
        return NOTHING, tau, phi
    if hit:
        return _collision_on_path(world, here, k, x0, x1, v0, u, tau, n, arm, stays), tau, phi
    return _press_on_path(world, here, k, x0, x1, u, depth, tau, phi, n, arm, stays), tau, phi


@inlined
def _meeting(world, here, k, x0, x1, v0, u, hit):
    """
    Touch of a collider as `detect` finds it, a collision or a contact, or NOTHING.

    And its time on the path, 0 without `sweep`, and the distance [m] at the end.
    """
    rules = world.rules
    depth = starts_inside(world, here, k, x0)
    if rules.sweep:
        return by_address(rules.present.modules, MEETING_ON_PATH, meeting_on_path,
                          (NOTHING, 0.0, 0.0), (world, here, k, depth, x0, x1, v0, u, hit))
    phi, n = end_distance(world, here, k, x0, x1)
    if phi >= 0.0 or (hit and depth > 0.0):
        return NOTHING, 0.0, phi
    n, stays, _ = contact_normal(world, here, k, x0, x1, depth, phi, n)
    if hit:
        return _collision_at(world, here, k, x0, x1, v0, u, phi, n, stays), 0.0, phi
    return _press_at(world, here, k, x0, x1, u, depth, phi, n, stays), 0.0, phi


@kernel
def foremost(world, here, touch, x0, x1, v0, u):
    """
    Find the collider to act on first, of those that are met just when that of a touch is, as deep.

    Parameters
    ----------
    world, here, x0, x1, v0, u
        As in `detect`.
    touch : Touch
        What `detect` has found.

    Returns
    -------
    first : Touch
        By ties.is_before, whatever the order of colliders is.
    tau, phi, blur : float [-], [m], [m]
        When they are met, how deep they are, and how much of that is only rounding.

    """
    table, poses = world.table, world.poses
    v, first = (v0 if touch.hit else u), touch
    _, tau, phi = _meeting(world, here, touch.collider, x0, x1, v0, u, touch.hit)
    blur = rounding_depth(world, here, touch.collider, x0)
    for m in range(here.chosen.shape[0]):
        other = _tied(world, here, here.chosen[m], touch, tau, phi, blur, x0, x1, v0, u)
        if other.collider != NONE and is_before(table, poses, here.end, other, first, v):
            first = other
    return first, tau, phi, blur


@inlined
def _tied(world, here, k, touch, tau, phi, blur, x0, x1, v0, u):
    """Return the Touch of collider k if it is met at time tau, and as deep as phi; or NOTHING."""
    other, tau_k, phi_k = _meeting(world, here, k, x0, x1, v0, u, touch.hit)
    if (other.collider != NONE and abs(tau_k - tau) <= SAME_TIME and other.stays == touch.stays
            and abs(phi_k - phi) <= blur + rounding_depth(world, here, k, x0)):
        return other
    return NOTHING


@kernel
def next_rival(world, here, touch, tied, x0, x1, v0, u, first):
    """
    Find the next collider that a particle meets just like that of a touch: as deep, and as fast.

    Parameters
    ----------
    world, here, x0, x1, v0, u
        As in `detect`.
    touch : Touch
        The first one, of `foremost`.
    tied : (3,) tuple of float
        What else that has found.
    first : int
        From which of the chosen colliders on.

    Returns
    -------
    other : Touch
        NOTHING if there is none; with a parallel normal it is the same surface, and not counted.
    later : int
        From which one on to look for more.

    """
    for m in range(first, here.chosen.shape[0]):
        k = here.chosen[m]
        if k == touch.collider:
            continue
        other = _tied(world, here, k, touch, tied[0], tied[1], tied[2], x0, x1, v0, u)
        if other.collider != NONE and lacks_alike(touch, other, v0 if touch.hit else u):
            cosine = dot(touch.normal, other.normal)
            if 1.0 - cosine * cosine >= PARALLEL:
                return other, m + 1
    return NOTHING, here.chosen.shape[0]


@kernel
def rivals(world, here, touch, tied, x0, x1, v0, u):
    """
    Find the colliders that a particle meets just like that of a touch.

    Parameters
    ----------
    world, here, touch, tied, x0, x1, v0, u
        As in `next_rival`.

    Returns
    -------
    two : Touch
        The first of them, NOTHING if there is none.
    more : bool
        Whether there are others.
    push : (3,) tuple of float [-]
        Sum of the normals of all; to the last bit whatever their order is, as they are rounded to
        multiples of UNIT. Zero where it does not push off all of them alike, or where these move
        in different ways.
    eps : float [-]
        Between the least and the largest restitution.

    """
    table = world.table
    two, m = next_rival(world, here, touch, tied, x0, x1, v0, u, 0)
    push, other, more = to_units(touch.normal), two, False
    least = most = table[touch.collider, RESTITUTION]
    while other.collider != NONE:
        push = add(push, to_units(other.normal))
        least = min(least, table[other.collider, RESTITUTION])
        most = max(most, table[other.collider, RESTITUTION])
        other, m = next_rival(world, here, touch, tied, x0, x1, v0, u, m)
        more = more or other.collider != NONE
    along, other, m = dot(push, touch.normal), two, 0
    while more and other.collider != NONE:
        other, m = next_rival(world, here, touch, tied, x0, x1, v0, u, m)
        if other.collider != NONE:
            blur = ROUNDING * (largest(other.obj) + largest(touch.obj))
            if (not abs(dot(push, other.normal) - along) <= ALIKE * along
                    or largest(subtract(other.obj, touch.obj)) > blur):
                push = (0.0, 0.0, 0.0)
    return two, more, push, 0.5 * (least + most)


@inlined
def detect(world, here, x0, x1, v0, u, collides):
    """Find the next collider to act on: along the path with sweeps, else at the end."""
    rules = world.rules
    if rules.sweep:
        return by_address(rules.present.modules, SURVEY_PATH, survey_path, (NOTHING, 0),
                          (world, here, x0, x1, v0, u, collides))
    return survey(world, here, x0, x1, v0, u, collides)


@inlined
def blocker(world, here, x0, x1):
    """Return the collider that is hit first on the way, or NONE; without sweeps no way matters."""
    rules = world.rules
    if rules.sweep:
        return by_address(rules.present.modules, BLOCKER, first_on_way, NONE,
                          (world, here, x0, x1))
    return NONE


@kernel
def first_on_way(world, here, x0, x1):
    """
    Return the collider that is hit first on the way, or NONE.

    The way from one point of a round surface to the next is a chord inside it: leaving from a
    surface to the same side of it is clear.
    """
    blocking, first, normal, dx = NONE, NEVER, (0.0, 0.0, 1.0), subtract(x1, x0)
    for m in range(here.chosen.shape[0]):
        k = here.chosen[m]
        if starts_inside(world, here, k, x0) > 0.0:
            continue
        tau, n, arm, _ = path_hit(world, here, k, x0, x1)
        n_end = end_distance(world, here, k, x0, x1)[1]
        slides = tau == 0.0 and dot(n, n_end) > SAME_SIDE
        obj = path_velocity(world.motion, here.step, k, arm, 1.0)
        earlier = tau < first
        if blocking != NONE and abs(tau - first) <= SAME_TIME:
            earlier = stands_first(world.table, world.poses, here.end, k, n, blocking, normal)
        if earlier and not slides and approach(dx, obj, n) < 0.0:
            blocking, first, normal = k, tau, n
    return blocking
