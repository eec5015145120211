#!/usr/bin/python3
"""The node that waits for RViz. This test looks like RViz: it listens to the markers, and offers
~reload_shaders when its window would be there."""
import unittest

import rospy
import rostest
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Empty, EmptyResponse, Trigger
from visualization_msgs.msg import MarkerArray

from ball_sim.msg import BallStates
from ball_sim.srv import SpawnBall, Step
from geometry_msgs.msg import Point
from support import Listener, call, scene, start_node

START = 1000000000  # ns
# Frames of 10 ms or longer, so at least 3 s: the node looks for RViz 5 times a second and starts
# 1.5 s after it was seen. A node that waits as it should passes however long they take.
MANY_FRAMES = 300


class ViewerWaitTest(unittest.TestCase):

    def setUp(self):
        self.name = self.id().split('_')[-1]
        self.markers = Listener(self.name + '/markers', MarkerArray)
        self.clock = Listener('/clock', Clock)
        self.window = None
        self.node = None

    def tearDown(self):
        self.output_to_its_end()
        if self.window:
            self.window.shutdown()
        self.markers.close()
        self.clock.close()

    def start(self, patience, **parameters):
        self.node = start_node(self.name, scene=scene('table'), wait_for_viewer=patience,
                               **parameters)
        self.clock.wait_count(1)

    def output_to_its_end(self):
        """What the node has said; it comes late, as a pipe is written to in blocks."""
        self.node.stop()
        self.node.wait()
        return self.node.output()

    def open_window(self):
        self.window = rospy.Service('~reload_shaders', Empty, lambda _: EmptyResponse())

    def time(self):
        """The clock's last, ns."""
        return self.clock.messages()[-1].clock.to_nsec()

    def assert_stands(self, at):
        self.clock.clear()
        stamps = {m.clock.to_nsec() for m in self.clock.wait_count(MANY_FRAMES)}
        self.assertEqual(stamps, {at})

    def assert_runs(self):
        now = self.time()
        self.clock.wait(lambda m: m.clock.to_nsec() > now + 10**8, 'time that goes on')

    def test_starts_when_the_window_is_there(self):
        states = Listener(self.name + '/ball_states', BallStates)
        self.start(600)
        self.markers.wait(lambda m: m.markers, 'markers while waiting')
        self.assert_stands(START)  # though somebody listens
        self.open_window()
        self.assertEqual(states.wait_count(1)[0].header.stamp.to_nsec(), START + 20000000)
        self.assert_runs()
        self.assertEqual(self.output_to_its_end().count('until RViz shows the balls'), 1)

    def test_starts_without_it_when_patience_ends(self):
        self.start(0.1)
        self.assert_runs()
        self.assertIn('has not come within 0.1 s', self.output_to_its_end())

    def test_resume(self):
        self.start(600)
        self.assertEqual(call(self.name + '/resume', Trigger).message, 'running')
        self.assert_runs()

    def test_pause(self):
        self.start(600)
        self.assertTrue(call(self.name + '/pause', Trigger).success)
        self.open_window()
        self.assert_stands(START)

    def test_step(self):
        self.start(600)
        answer = call(self.name + '/step', Step, seconds=0.1)
        self.assertTrue(answer.success, answer.message)
        self.open_window()
        self.clock.wait(lambda m: m.clock == answer.stamp)
        self.assert_stands(START + 10**8)

    def test_spawn(self):
        """Other services work, and leave the wait alone."""
        self.start(600)
        answer = call(self.name + '/spawn_ball', SpawnBall, position=Point(0.5, 0.5, 0))
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(answer.stamp.to_nsec(), START)
        self.assert_stands(START)
        self.open_window()
        self.assert_runs()

    def test_paused(self):
        """Who starts it paused wants to resume it himself."""
        self.start(600, start_paused=True)
        self.open_window()
        self.assert_stands(START)


if __name__ == '__main__':
    rospy.init_node('viewer_wait_test')
    rostest.rosrun('ball_sim', 'viewer_wait_test', ViewerWaitTest)
