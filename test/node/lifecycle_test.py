#!/usr/bin/python3
"""How the node starts, refuses to start, keeps answering under load, and ends."""
import signal
import threading
import unittest

import rospy
import rostest
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from ball_sim.msg import BallProperties, BallStates, Code, SimStats
from ball_sim.srv import ApplyImpulse, Step
from geometry_msgs.msg import Vector3
from support import Listener, Process, call, scene, start_node, wait_until


class LifecycleTest(unittest.TestCase):

    def setUp(self):
        self.nodes = []

    def tearDown(self):
        for node in self.nodes:
            node.stop()

    def start(self, name, **parameters):
        parameters.setdefault('scene', scene('table'))
        node = start_node(name, **parameters)
        self.nodes.append(node)
        return node

    # --- start

    def test_parameters_out_of_range_are_fatal(self):
        cases = [('clock_rate', '5', '10 to 250'), ('clock_rate', '251', '10 to 250'),
                 ('clock_rate', '.nan', '10 to 250'), ('clock_rate', 'fast', '10 to 250'),
                 ('state_rate', '-1', '0 or 0.001 to 1000'), ('state_rate', '1001', '1000'),
                 ('marker_rate', '61', '0 or 0.1 to 60'),
                 ('real_time_factor', '-1', '0 or 0.001 to 1000'),
                 ('wait_for_viewer', '601', '0 or 0.1 to 600'),
                 ('start_time', '0', '1e-09 to 4000000000'),
                 ('time_step', '2', '0 or 1e-09 to 1'), ('time_step', '-1', '0 or 1e-09'),
                 ('tolerance', '2', '0 or 1e-15 to 1'), ('threads', '0', '1 to 1024'),
                 ('threads', '1.5', 'whole number'), ('seed', '-2', '-1 to 2147483647'),
                 ('seed', '1.5', 'whole number'), ('max_balls', '0', '1 to 10000000'),
                 ('max_events_per_frame', '0', '1 to 1000000000'),
                 ('wall_timeout', '0', '0.1 to 60'), ('color_by', 'taste', 'id, speed, radius, mass'),
                 ('publish_clock', '7', 'true or false'), ('start_paused', 'soon', 'true or false'),
                 ('method', 'magic', 'event_driven'), ('scene', 'atlantis', 'break_shot'),
                 ('scene', '/no/such/file.yaml', 'no such scene')]
        nodes = [(self.start('bad_%d' % i, **{name: value}), name, value, rule)
                 for i, (name, value, rule) in enumerate(cases)]
        for node, name, value, rule in nodes:
            self.assertEqual(node.wait(), 1, name + ' ' + value)
            self.assertIn('FATAL', node.output())
            for word in (name, value.strip('.'), rule):
                self.assertIn(word, node.output())

    def test_parameters_go_before_the_scene(self):
        for i, (method, reason, parameters) in enumerate((
                ('discrete', 'in steps of 0.002 s', {'method': 'discrete', 'time_step': 0.002}),
                ('discrete', 'in steps of 0.001 s', {'method': 'discrete', 'time_step': 0}),
                ('event_driven', 's at 0.0001', {'tolerance': 1e-4}),
                ('event_driven', 's at 0.01', {'tolerance': 0}),
                ('continuous', 'asked for', {'method': 'continuous', 'threads': 2}))):
            name = 'asked_%d' % i
            node = self.start(name, scene=scene('gas'), **parameters)
            stats = Listener(name + '/stats', SimStats)
            message = stats.wait(lambda m: m.balls == 300)
            self.assertEqual(message.method, method)
            self.assertIn(reason, message.method_reason)
            stats.close()
            node.stop()

    def test_roslaunch_shows_why_the_node_ended(self):
        process = Process(['roslaunch', 'ball_sim', 'simulation.launch', 'rviz:=false',
                           'scene:=atlantis'])
        self.nodes.append(process)
        process.wait()
        for word in ('FATAL', 'atlantis', 'break_shot', 'two_balls'):
            self.assertIn(word, process.output())

    def test_bad_scene_is_fatal(self):
        node = self.start('bad_scene', scene=scene('broken'))
        self.assertEqual(node.wait(), 1)
        for word in ('FATAL', 'broken.yaml', 'radius', '-1'):
            self.assertIn(word, node.output())

    def test_too_many_balls_for_max_balls_are_fatal(self):
        node = self.start('crowded', max_balls=3)
        self.assertEqual(node.wait(), 1)
        self.assertIn('3', node.output())

    def test_unknown_parameter_is_a_warning_that_names_the_nearest(self):
        node = self.start('misspelt', clok_rate=100)
        wait_until(lambda: 'unknown' in node.output(), 'the warning')
        self.assertIn('~clok_rate', node.output())
        self.assertIn('~clock_rate', node.output())
        call('misspelt/pause', Trigger)  # it runs all the same

    def test_seed_makes_other_balls(self):
        first = []
        for name, seed in (('seed_a', 5), ('seed_b', 5), ('seed_c', 6)):
            states = Listener(name + '/ball_states', BallStates)
            self.start(name, scene=scene('gas'), seed=seed, start_paused=True)
            states.wait_for_publisher()
            reached = call(name + '/step', Step, steps=1).stamp
            first.append(states.wait(lambda m, t=reached: m.header.stamp == t).positions)
        self.assertEqual(first[0], first[1])
        self.assertNotEqual(first[0], first[2])

    def test_start_time_and_rates(self):
        states = Listener('rates/ball_states', BallStates)
        self.start('rates', start_time=1000, state_rate=60, start_paused=True, publish_clock=False)
        states.wait_for_publisher()
        reached = call('rates/step', Step, steps=60).stamp
        states.wait(lambda m: m.header.stamp == reached, 'states at the end of the step')
        stamps = [m.header.stamp.to_nsec() for m in states.messages()]
        if stamps[0] == 1000 * 10**9:  # the start itself, for who was there in time
            stamps.pop(0)
        self.assertEqual(stamps, [1000 * 10**9 + (k * 10**9 + 30) // 60 for k in range(1, 61)])

    def test_publish_clock_off(self):
        self.start('clockless', publish_clock=False)
        call('clockless/pause', Trigger)
        publishers = rospy.get_master().getSystemState()[2][0]
        self.assertNotIn('/clockless', [n for t, nodes in publishers if t == '/clock' for n in nodes])

    def test_state_rate_and_marker_rate_zero(self):
        states = Listener('quiet/ball_states', BallStates)
        stats = Listener('quiet/stats', SimStats)
        self.start('quiet', state_rate=0, marker_rate=0, start_paused=True)
        states.wait_for_publisher()
        self.assertEqual(call('quiet/step', Step, steps=5).stamp.to_nsec(), 1100000000)
        stats.wait(lambda m: m.simulated_time == 0.1)
        self.assertEqual(states.messages(), [])

    # --- under load

    def test_real_time_factor_zero_runs_as_fast_as_it_can(self):
        stats = Listener('fast/stats', SimStats)
        self.start('fast', real_time_factor=0)
        # Four balls on a table need microseconds for a second; 10 leaves room for any machine.
        stats.wait(lambda m: m.real_time_factor > 10, 'a run faster than real time')

    def test_overloaded_node_answers_slows_time_and_keeps_the_grid(self):
        """A million messages of 300 balls a wall second are more than any machine publishes."""
        states = Listener('slow/ball_states', BallStates)
        stats = Listener('slow/stats', SimStats)
        self.start('slow', scene=scene('gas'), real_time_factor=1000, state_rate=1000)
        last = stats.wait(lambda m: m.late_frames > 0 and m.simulated_time > 1, 'late frames')
        self.assertLess(last.real_time_factor, 1000)
        self.assertTrue(call('slow/pause', Trigger).success)
        stamps = [m.header.stamp.to_nsec() for m in states.wait_count(1)]
        self.assertTrue(all(stamp % 10**6 == 0 for stamp in stamps))

    def test_step_ends_at_the_wall_timeout(self):
        self.start('long', scene=scene('gas'), wall_timeout=0.1, start_paused=True)
        answer = call('long/step', Step, seconds=3600)
        self.assertTrue(answer.success)
        self.assertEqual(answer.code, Code.TIMED_OUT)
        self.assertLess(answer.stamp.to_sec(), 3601)
        again = call('long/step', Step, seconds=1e-9)
        self.assertEqual(again.stamp.to_nsec(), answer.stamp.to_nsec() + 1)

    # --- end

    def assert_ends(self, node, number):
        node.signal(number)
        self.assertEqual(node.wait(), 0, node.output())

    def test_interrupt_ends_it(self):
        for name, paused in (('running', False), ('standing', True)):
            node = self.start(name, start_paused=paused)
            call(name + '/pause', Trigger)
            self.assert_ends(node, signal.SIGINT)

    def test_terminate_ends_it(self):
        node = self.start('terminated')
        call('terminated/resume', Trigger)
        self.assert_ends(node, signal.SIGTERM)

    def test_interrupt_in_the_middle_of_long_work_ends_it(self):
        node = self.start('busy', scene=scene('gas'), real_time_factor=0, wall_timeout=60,
                          start_paused=True)
        properties = Listener('busy/ball_properties', BallProperties)
        properties.wait_count(1)
        clock = Listener('/clock', Clock)
        clock.wait_count(1)
        answers = []
        step = threading.Thread(target=lambda: answers.append(self.call_or_none('busy')))
        step.start()
        clock.wait(lambda m: m.clock.to_sec() > 1, 'the clock of a step that runs')
        self.assert_ends(node, signal.SIGINT)
        step.join(30)
        self.assertFalse(step.is_alive())

    def test_interrupt_with_a_kick_to_come_ends_it(self):
        node = self.start('waiting', wall_timeout=60, start_paused=True)
        rospy.wait_for_service('waiting/apply_impulse', 30)
        kick = threading.Thread(target=lambda: self.call_or_none('waiting', kick=True))
        kick.start()
        kick.join(1)
        self.assertTrue(kick.is_alive())
        self.assert_ends(node, signal.SIGINT)
        kick.join(30)
        self.assertFalse(kick.is_alive())

    @staticmethod
    def call_or_none(name, kick=False):
        """The answer, or None when the node ended first."""
        try:
            if kick:
                return call(name + '/apply_impulse', ApplyImpulse, id=0, impulse=Vector3(1, 0, 0),
                            at=1000)
            return call(name + '/step', Step, seconds=3600)
        except (rospy.ServiceException, rospy.ROSException):
            return None


if __name__ == '__main__':
    rospy.init_node('lifecycle_test')
    rostest.rosrun('ball_sim', 'lifecycle_test', LifecycleTest)
