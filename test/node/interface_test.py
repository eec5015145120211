#!/usr/bin/python3
"""Every topic and service of the node, on a table of four balls; see scenes/table.yaml.

The simulation stands still but for steps, so that stamps and places are known in advance.
"""
import math
import unittest

import rospy
import rostest
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

from ball_sim.msg import (Ball, BallProperties, BallStates, Code, Collision, Collisions, SimStats)
from ball_sim.srv import (ApplyImpulse, DeleteBalls, Reset, SpawnBall, SpawnBalls, Step)
from geometry_msgs.msg import Point, Vector3
from support import Listener, call

ROUNDING = 1e-12  # places are of size 1 and come from a few operations, each off by 1e-16
MILLISECOND = 1000000  # ns


def stamp_of(message):
    return message.header.stamp.to_nsec()


class InterfaceTest(unittest.TestCase):

    def setUp(self):
        call('ball_sim/pause', Trigger)
        self.assertTrue(call('ball_sim/reset', Reset, what='time').success)
        self.listeners = []

    def tearDown(self):
        for listener in self.listeners:
            listener.close()

    def listen(self, name, message_type):
        listener = Listener(name if name[0] == '/' else 'ball_sim/' + name, message_type)
        self.listeners.append(listener)
        listener.wait_for_publisher()
        return listener

    def listen_to_clock(self):
        """From the reset on: a message from before it may still be under way on a busy machine."""
        clock = self.listen('/clock', Clock)
        clock.wait(lambda m: m.clock.to_nsec() == 1000 * MILLISECOND, 'the time of the reset')
        clock.clear()
        return clock

    def states_after(self, **step):
        """The balls at the next instant of ~ball_states after a step; the step ends there."""
        states = self.listen('ball_states', BallStates)
        reached = self.step(**step)
        return states.wait(lambda m: m.header.stamp == reached, 'states at the end of the step')

    def step(self, **fields):
        answer = call('ball_sim/step', Step, **fields)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(answer.code, Code.NONE)
        return answer.stamp

    def spawn(self, x, y, **fields):
        return call('ball_sim/spawn_ball', SpawnBall, position=Point(x, y, 0), **fields)

    def ids(self):
        """The ids present, by the latched properties."""
        return list(self.properties().ids)

    def properties(self):
        """The latest ones; the node sends them before it answers who changed them."""
        return rospy.wait_for_message('ball_sim/ball_properties', BallProperties, 30)

    def assert_refused(self, answer, code, *words):
        self.assertFalse(answer.success)
        self.assertEqual(answer.code, code, answer.message)
        for word in words:
            self.assertIn(word, answer.message)

    # --- time

    def test_clock_goes_on_while_paused(self):
        stamps = [m.clock.to_nsec() for m in self.listen_to_clock().wait_count(5)]
        self.assertEqual(stamps, [1000 * MILLISECOND] * 5)

    def test_clock_advances_evenly_when_running(self):
        clock = self.listen_to_clock()
        call('ball_sim/resume', Trigger)
        clock.wait(lambda m: m.clock.to_nsec() > 1300 * MILLISECOND)
        call('ball_sim/pause', Trigger)
        stamps = [m.clock.to_nsec() for m in clock.messages()]
        for earlier, later in zip(stamps, stamps[1:]):
            # A frame is 10 ms; commands end none early, and the budget of events is never spent.
            self.assertIn(later - earlier, (0, 10 * MILLISECOND))

    def test_states_are_on_an_exact_grid(self):
        states = self.listen('ball_states', BallStates)
        self.assertEqual(self.step(steps=5).to_nsec(), 1100 * MILLISECOND)
        self.assertEqual(self.step(seconds=0.005).to_nsec(), 1105 * MILLISECOND)
        self.assertEqual(self.step(steps=1).to_nsec(), 1120 * MILLISECOND)
        states.wait(lambda m: stamp_of(m) == 1120 * MILLISECOND)
        self.assertEqual([stamp_of(m) for m in states.messages()],
                         [(1000 + 20 * k) * MILLISECOND for k in range(1, 7)])

    def test_states_keep_the_grid_when_running(self):
        states = self.listen('ball_states', BallStates)
        call('ball_sim/resume', Trigger)
        stamps = [stamp_of(m) for m in states.wait_count(20)]
        call('ball_sim/pause', Trigger)
        self.assertEqual(stamps, [(1000 + 20 * k) * MILLISECOND for k in range(1, 21)])

    def test_states_are_exact_at_their_stamp(self):
        states = self.states_after(steps=5)
        self.assertEqual(list(states.ids), [0, 1, 2, 3])
        self.assertEqual(states.header.frame_id, 'world')
        self.assertAlmostEqual(states.positions[0].x, -0.4, delta=ROUNDING)  # -0.5 m + 0.1 s * 1 m/s
        self.assertEqual(states.velocities[0].x, 1)
        self.assertEqual(states.positions[1].x, 0.5)

    def test_step_refusals(self):
        self.assert_refused(call('ball_sim/step', Step), Code.OUT_OF_RANGE)
        self.assert_refused(call('ball_sim/step', Step, steps=1, seconds=1), Code.OUT_OF_RANGE)
        self.assert_refused(call('ball_sim/step', Step, steps=100001), Code.OUT_OF_RANGE, '100001')
        self.assert_refused(call('ball_sim/step', Step, seconds=-1), Code.OUT_OF_RANGE, '-1')
        self.assert_refused(call('ball_sim/step', Step, seconds=3601), Code.OUT_OF_RANGE, '3601')
        self.assert_refused(call('ball_sim/step', Step, seconds=math.nan), Code.NOT_FINITE)
        self.assertEqual(self.step(seconds=1e-9).to_nsec(), 1000 * MILLISECOND + 1)
        call('ball_sim/resume', Trigger)
        self.assert_refused(call('ball_sim/step', Step, steps=1), Code.NOT_PAUSED, 'pause')

    def test_pause_and_resume_are_idempotent(self):
        messages = [call('ball_sim/' + name, Trigger) for name in
                    ('pause', 'resume', 'resume', 'toggle_pause', 'toggle_pause', 'pause')]
        self.assertTrue(all(m.success for m in messages))
        self.assertEqual([m.message for m in messages],
                         ['already paused', 'running', 'already running', 'paused', 'running',
                          'paused'])

    # --- what is told of the balls

    def test_collisions(self):
        collisions = self.listen('collisions', Collisions)
        self.step(seconds=1.0)
        impact = collisions.wait(lambda m: m.collisions).collisions[0]
        # Ball 0 goes 0.9 m at 1 m/s until the centres are 0.1 m apart; equal masses swap.
        self.assertEqual(impact.stamp.to_nsec(), 1900 * MILLISECOND)
        self.assertEqual((impact.a, impact.b), (0, 1))
        self.assertAlmostEqual(impact.point.x, 0.45, delta=ROUNDING)
        self.assertAlmostEqual(impact.normal.x, 1, delta=ROUNDING)
        self.assertAlmostEqual(impact.impulse, 2, delta=ROUNDING)
        self.assertAlmostEqual(impact.approach_speed, 1, delta=ROUNDING)
        # Ball 1 then goes 0.45 m to the wall at x = 1.
        collisions.clear()
        self.step(seconds=0.5)
        impact = collisions.wait(lambda m: m.collisions).collisions[0]
        self.assertEqual((impact.a, impact.b), (1, Collision.X_MAX))
        self.assertAlmostEqual(impact.stamp.to_nsec(), 2350 * MILLISECOND, delta=1)

    def test_properties(self):
        properties = self.properties()
        self.assertEqual(list(properties.ids), [0, 1, 2, 3])
        self.assertEqual(list(properties.radii), [0.05, 0.05, 0.1, 0.1])
        self.assertEqual(list(properties.masses), [2, 2, 1, math.inf])
        self.assertEqual(properties.restitution, 1)
        self.assertEqual(len(set((c.r, c.g, c.b, c.a) for c in properties.colors)), 4)

    def test_properties_are_repeated(self):
        self.listen('ball_properties', BallProperties).wait_count(2)

    def test_stats(self):
        stats = self.listen('stats', SimStats)
        reached = self.step(seconds=1.5)
        message = stats.wait(lambda m: m.header.stamp == reached)
        self.assertTrue(message.paused)
        self.assertEqual(message.simulated_time, 1.5)
        self.assertEqual(message.balls, 4)
        self.assertEqual(message.method, 'event_driven')
        self.assertNotEqual(message.method_reason, '')
        self.assertEqual(message.ball_collisions, 1)
        self.assertEqual(message.wall_collisions, 1)
        self.assertAlmostEqual(message.kinetic_energy, 1, delta=ROUNDING)  # 2 kg, 1 m/s
        self.assertAlmostEqual(message.momentum.x, -2, delta=ROUNDING)  # back from the wall
        self.assertAlmostEqual(message.energy_drift, 0, delta=ROUNDING)
        self.assertEqual(message.ambiguous_impacts, 0)
        self.assertEqual(message.dropped_collisions, 0)

    def test_stats_count_impacts_that_a_policy_decided(self):
        stats = self.listen('stats', SimStats)
        for x, speed, mass in ((-0.1, 1, 1), (0, 0, 2), (0.1, -1, 1)):  # they touch, and close in
            answer = self.spawn(x, -0.4, velocity=Vector3(speed, 0, 0), radius=0.05, mass=mass)
            self.assertTrue(answer.success, answer.message)
        reached = self.step(seconds=0.1)
        message = stats.wait(lambda m: m.header.stamp == reached)
        self.assertGreater(message.ambiguous_impacts, 0)

    def test_energy_drift_begins_anew_after_a_kick(self):
        stats = self.listen('stats', SimStats)
        call('ball_sim/apply_impulse', ApplyImpulse, id=2, impulse=Vector3(0, -1, 0))
        reached = self.step(seconds=0.1)
        message = stats.wait(lambda m: m.header.stamp == reached)
        self.assertAlmostEqual(message.kinetic_energy, 1.5, delta=ROUNDING)  # 1 kg, 1 m/s more
        self.assertAlmostEqual(message.energy_drift, 0, delta=ROUNDING)

    def test_markers(self):
        markers = self.listen('markers', MarkerArray).wait(lambda m: m.markers).markers
        self.assertEqual([m.scale.x for m in markers if m.action == Marker.ADD], [0.1, 0.2])
        for marker in markers:
            self.assertEqual(marker.type, Marker.SPHERE_LIST)
            self.assertEqual(len(marker.points), len(marker.colors))
            self.assertFalse(marker.frame_locked)
            self.assertEqual(marker.lifetime.to_nsec(), 0)
            self.assertEqual(marker.pose.orientation.w, 1)
        self.assertEqual([(p.x, p.y) for p in markers[0].points], [(-0.5, 0), (0.5, 0)])
        self.assertEqual([(p.x, p.y) for p in markers[1].points], [(0, 0.8), (0, -0.8)])

    def test_markers_of_an_emptied_radius_are_deleted(self):
        listener = self.listen('markers', MarkerArray)
        call('ball_sim/delete_balls', DeleteBalls, ids=[2, 3])
        gone = listener.wait(lambda m: any(k.action == Marker.DELETE for k in m.markers))
        self.assertEqual([(k.id, k.action) for k in gone.markers],
                         [(0, Marker.ADD), (1, Marker.DELETE)])
        call('ball_sim/delete_balls', DeleteBalls, all=True)
        listener.wait(lambda m: all(k.action == Marker.DELETE for k in m.markers))
        for message in listener.messages():
            for marker in message.markers:
                self.assertEqual(marker.action == Marker.ADD, len(marker.points) > 0)

    def test_scene_markers(self):
        scene = self.listen('scene_markers', MarkerArray).wait(lambda m: m.markers).markers
        table = next(m for m in scene if m.ns == 'table')
        top = table.pose.position.z + table.scale.z / 2
        self.assertAlmostEqual(top, -0.1, delta=ROUNDING)  # under the largest ball
        self.assertEqual(sum(m.ns == 'cushions' for m in scene), 4)
        for marker in scene:
            self.assertEqual(marker.color.a, 1)
            self.assertFalse(marker.frame_locked)
            self.assertEqual(marker.header.frame_id, 'world')

    # --- spawn and delete

    def test_spawn_takes_the_scenes_defaults(self):
        answer = self.spawn(0.5, 0.5)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(answer.id, 4)
        self.assertEqual(answer.stamp.to_nsec(), 1000 * MILLISECOND)
        properties = self.properties()
        self.assertEqual(list(properties.ids), [0, 1, 2, 3, 4])
        self.assertEqual((properties.radii[4], properties.masses[4]), (0.05, 2))

    def test_spawn_as_asked(self):
        answer = self.spawn(0.5, 0.5, radius=0.2, mass=3, velocity=Vector3(0, 1, 0))
        self.assertTrue(answer.success, answer.message)
        states = self.states_after(steps=5)
        self.assertEqual(states.ids[4], answer.id)
        self.assertAlmostEqual(states.positions[4].y, 0.6, delta=ROUNDING)

    def test_spawn_refusals_change_nothing(self):
        nan, inf = math.nan, math.inf
        for code, word, fields in (
                (Code.NOT_FINITE, 'position', {'position': Point(nan, 0, 0)}),
                (Code.NOT_FINITE, 'position', {'position': Point(0, inf, 0)}),
                (Code.NOT_FINITE, 'velocity', {'velocity': Vector3(0, nan, 0)}),
                (Code.NOT_FINITE, 'radius', {'radius': nan}),
                (Code.NOT_FINITE, 'mass', {'mass': nan}),
                (Code.OUT_OF_RANGE, 'radius', {'radius': -0.1}),
                (Code.OUT_OF_RANGE, 'mass', {'mass': -1}),
                (Code.OUTSIDE, 'position', {'position': Point(0.97, 0, 0)}),
                (Code.OUTSIDE, 'position', {'position': Point(5, 0, 0)}),
                (Code.OVERLAP, '1', {'position': Point(0.45, 0, 0)}),
                (Code.NOT_PLANAR, 'position', {'position': Point(0.5, 0.5, 0.1)}),
                (Code.NOT_PLANAR, 'velocity', {'velocity': Vector3(0, 0, 1)})):
            fields.setdefault('position', Point(0.5, 0.5, 0))
            answer = call('ball_sim/spawn_ball', SpawnBall, **fields)
            self.assert_refused(answer, code, word)
        self.assertEqual(self.ids(), [0, 1, 2, 3])

    def test_spawn_stops_at_the_ball_limit(self):
        for x in (-0.9, -0.7, 0.7, 0.9):
            self.assertTrue(self.spawn(x, 0.5).success)
        self.assert_refused(self.spawn(-0.9, -0.5), Code.BALL_LIMIT, '8')
        self.assertEqual(len(self.ids()), 8)

    def test_spawn_balls(self):
        balls = [Ball(position=Point(x, 0.5, 0)) for x in (0.5, 0.7)]
        answer = call('ball_sim/spawn_balls', SpawnBalls, balls=balls)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(list(answer.ids), [4, 5])
        self.assertEqual(list(answer.codes), [Code.NONE, Code.NONE])

    def test_spawn_balls_is_all_or_none(self):
        balls = [Ball(position=Point(x, 0.5, 0)) for x in (0.5, 2, 0.7)]
        answer = call('ball_sim/spawn_balls', SpawnBalls, balls=balls)
        self.assert_refused(answer, Code.OUTSIDE, 'balls[1]')
        self.assertEqual(list(answer.codes), [Code.REJECTED_WITH_OTHERS, Code.OUTSIDE,
                                              Code.REJECTED_WITH_OTHERS])
        self.assertEqual(list(answer.ids), [])
        self.assertEqual(self.ids(), [0, 1, 2, 3])

    def test_spawn_balls_must_not_overlap_each_other(self):
        balls = [Ball(position=Point(x, 0.5, 0)) for x in (0.5, 0.55)]
        answer = call('ball_sim/spawn_balls', SpawnBalls, balls=balls)
        self.assert_refused(answer, Code.OVERLAP)
        self.assertEqual(self.ids(), [0, 1, 2, 3])

    def test_delete(self):
        answer = call('ball_sim/delete_balls', DeleteBalls, ids=[0, 2, 0])
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(answer.deleted, 2)
        self.assertEqual(self.ids(), [1, 3])
        self.assertEqual(self.spawn(0.5, 0.5).id, 4)  # ids are never used twice
        answer = call('ball_sim/delete_balls', DeleteBalls, all=True)
        self.assertEqual(answer.deleted, 3)
        self.assertEqual(self.ids(), [])

    def test_delete_refusals_change_nothing(self):
        self.assert_refused(call('ball_sim/delete_balls', DeleteBalls, ids=[0, 77, 99]),
                            Code.UNKNOWN_BALL, '77', '99')
        self.assert_refused(call('ball_sim/delete_balls', DeleteBalls), Code.OUT_OF_RANGE)
        self.assertEqual(self.ids(), [0, 1, 2, 3])

    # --- kicks

    def kick(self, **fields):
        return call('ball_sim/apply_impulse', ApplyImpulse, **fields)

    def test_kick_now(self):
        answer = self.kick(id=0, impulse=Vector3(2, 4, 0))
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(answer.stamp.to_nsec(), 1000 * MILLISECOND)
        self.assertEqual((answer.velocity_before.x, answer.velocity_before.y), (1, 0))
        self.assertEqual((answer.velocity_after.x, answer.velocity_after.y), (2, 2))  # 2 kg
        states = self.states_after(steps=5)
        self.assertAlmostEqual(states.positions[0].y, 0.2, delta=ROUNDING)

    def test_kick_at_an_exact_time_to_come(self):
        states = self.listen('ball_states', BallStates)
        call('ball_sim/resume', Trigger)
        answer = self.kick(id=2, impulse=Vector3(0, -0.1, 0), at=3.0123)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(answer.stamp.to_nsec(), 3012300000)
        after = states.wait(lambda m: stamp_of(m) == 3100 * MILLISECOND)
        # 0.0877 s after the kick, at 0.1 m/s
        self.assertAlmostEqual(after.positions[2].y, 0.8 - 0.00877, delta=ROUNDING)

    def test_kick_in_time_that_never_comes_is_withdrawn(self):
        answer = self.kick(id=2, impulse=Vector3(0, -0.1, 0), at=1.5)  # it is paused
        self.assert_refused(answer, Code.TIMED_OUT, 'wall_timeout')
        states = self.states_after(seconds=1)
        self.assertEqual(states.positions[2].y, 0.8)

    def test_kick_refusals_change_nothing(self):
        self.step(seconds=0.5)
        push = Vector3(1, 0, 0)
        self.assert_refused(self.kick(id=77, impulse=push), Code.UNKNOWN_BALL, '77')
        self.assert_refused(self.kick(id=77, impulse=push, at=2), Code.UNKNOWN_BALL, '77')
        self.assert_refused(self.kick(id=3, impulse=push), Code.FIXED_BALL, '3')
        self.assert_refused(self.kick(id=2, impulse=Vector3(math.nan, 0, 0)), Code.NOT_FINITE)
        self.assert_refused(self.kick(id=2, impulse=Vector3(0, 0, 1)), Code.NOT_PLANAR)
        self.assert_refused(self.kick(id=2, impulse=push, at=1.4), Code.IN_THE_PAST, '1.4', '1.5')
        self.assert_refused(self.kick(id=2, impulse=push, at=math.nan), Code.NOT_FINITE)
        self.assert_refused(self.kick(id=2, impulse=push, at=-1), Code.OUT_OF_RANGE, '-1')
        states = self.states_after(seconds=0.1)
        self.assertEqual((states.positions[2].x, states.positions[2].y), (0, 0.8))

    # --- reset

    def test_reset_spawned(self):
        self.spawn(0.5, 0.5)
        call('ball_sim/delete_balls', DeleteBalls, ids=[2])
        self.step(seconds=0.1)
        answer = call('ball_sim/reset', Reset, what='spawned')
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(answer.stamp.to_nsec(), 1100 * MILLISECOND)
        self.assertEqual(self.ids(), [0, 1, 3])

    def test_reset_all_keeps_the_time(self):
        self.spawn(0.5, 0.5)
        call('ball_sim/delete_balls', DeleteBalls, ids=[2])
        self.step(seconds=0.5)
        answer = call('ball_sim/reset', Reset)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(answer.stamp.to_nsec(), 1500 * MILLISECOND)
        self.assertEqual(self.ids(), [0, 1, 2, 3])
        states = self.states_after(seconds=0.1)
        self.assertAlmostEqual(states.positions[0].x, -0.4, delta=ROUNDING)

    def test_reset_time(self):
        clock = self.listen('/clock', Clock)
        self.step(seconds=0.5)
        clock.wait(lambda m: m.clock.to_nsec() == 1500 * MILLISECOND)
        states = self.listen('ball_states', BallStates)
        answer = call('ball_sim/reset', Reset, what='time')
        self.assertEqual(answer.stamp.to_nsec(), 1000 * MILLISECOND)
        clock.clear()
        clock.wait(lambda m: m.clock.to_nsec() == 1000 * MILLISECOND)
        first = states.wait_count(1)[0]
        self.assertEqual(stamp_of(first), 1000 * MILLISECOND)
        self.assertEqual(first.positions[0].x, -0.5)

    def test_reset_refuses_what_it_does_not_know(self):
        self.step(seconds=0.5)
        answer = call('ball_sim/reset', Reset, what='everything')
        self.assert_refused(answer, Code.OUT_OF_RANGE, 'everything', 'spawned')
        self.assertEqual(answer.stamp.to_nsec(), 1500 * MILLISECOND)


if __name__ == '__main__':
    rospy.init_node('interface_test')
    rostest.rosrun('ball_sim', 'interface_test', InterfaceTest)
