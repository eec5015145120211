#!/usr/bin/python3
"""Records a real bag by simulation.launch, and shows it again by replay.launch."""
import glob
import os
import shutil
import signal
import tempfile
import unittest

import rosbag
import rospy
import rostest
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import Marker, MarkerArray

from ball_sim.msg import BallStates
from ball_sim.srv import SpawnBall
from geometry_msgs.msg import Point
from support import PATIENCE, Listener, Process, call, count_links, wait_until


class RecordReplayTest(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.process = None

    def tearDown(self):
        if self.process:
            self.process.stop()
        shutil.rmtree(self.folder)

    def record(self):
        """A bag of a little more than a second of the break shot, with a ball added in it."""
        self.process = Process(['roslaunch', 'ball_sim', 'simulation.launch', 'rviz:=false',
                                'record:=true', 'paused:=true',
                                'bag_prefix:=' + self.folder + '/run'])
        states = Listener('/ball_sim/ball_states', BallStates)
        states.wait_for_publisher()
        wait_until(self.recorder_listens, 'the recorder')
        call('/ball_sim/resume', Trigger)
        states.wait(lambda m: m.header.stamp.to_sec() >= 1.5)
        self.assertTrue(call('/ball_sim/spawn_ball', SpawnBall, position=Point(-1, -0.3, 0)).success)
        states.wait(lambda m: m.header.stamp.to_sec() >= 2)
        states.close()
        self.process.signal(signal.SIGINT)
        self.process.wait()
        bags = glob.glob(self.folder + '/run*.bag')
        self.assertEqual(len(bags), 1, self.process.output())
        return bags[0]

    @staticmethod
    def recorder_listens():
        return all(count_links('/ball_sim/' + topic, '/ball_sim_record') for topic in (
            'ball_states', 'ball_properties', 'collisions', 'stats', 'scene_markers'))

    def check(self, bag_path):
        """What the bag holds. Returns the recorded states."""
        with rosbag.Bag(bag_path) as bag:
            topics = bag.get_type_and_topic_info().topics
            self.assertEqual(set(topics), {'/ball_sim/' + name for name in (
                'ball_states', 'ball_properties', 'collisions', 'stats', 'scene_markers')})
            self.assertEqual(bag.get_compression_info().compression, 'lz4')
            states = [m for _, m, _ in bag.read_messages('/ball_sim/ball_states')]
            stamps = [m.header.stamp.to_nsec() for m in states]
            self.assertEqual(stamps, list(range(stamps[0], stamps[-1] + 1, 20000000)))
            self.assertGreaterEqual(len(states), 45)
            properties = [m for _, m, _ in bag.read_messages('/ball_sim/ball_properties')]
            self.assertEqual(list(properties[0].ids), list(states[0].ids))
            self.assertEqual(list(properties[-1].ids), list(states[-1].ids))
            self.assertEqual(len(states[-1].ids), len(states[0].ids) + 1)
            for _, message, time in bag.read_messages('/ball_sim/ball_states'):
                # Received in simulated time, at most a few frames after the stamp.
                self.assertLess(abs((time - message.header.stamp).to_sec()), 1)
        return states

    def replay(self, bag_path, recorded):
        """The last state's balls appear, in their places, with their colours."""
        listener = Listener('/ball_sim/markers', MarkerArray)
        table = Listener('/ball_sim/scene_markers', MarkerArray)
        relative = os.path.relpath(bag_path)
        self.process = Process(['roslaunch', 'ball_sim', 'replay.launch', 'rviz:=false',
                                'paused:=true', 'bag:=' + relative])
        wait_until(self.all_listen, 'the player and its listeners')
        call('/player/pause_playback', SetBool, data=False)
        last = recorded[-1]
        message = listener.wait(lambda m: m.markers and
                                m.markers[0].header.stamp == last.header.stamp, 'the last markers')
        self.assertTrue(table.wait(lambda m: m.markers))
        shown = [m for m in message.markers if m.action == Marker.ADD]
        self.assertEqual(len(shown), 1)  # all of one radius
        self.assertEqual([(p.x, p.y, p.z) for p in shown[0].points],
                         [(p.x, p.y, p.z) for p in last.positions])
        self.assertEqual(len(shown[0].colors), len(last.ids))
        nodes = rospy.get_master().getSystemState()[2][2]
        self.assertNotIn('/ball_sim', [n for _, providers in nodes for n in providers])
        self.process.signal(signal.SIGINT)
        self.process.wait(PATIENCE)

    @staticmethod
    def all_listen():
        return (all(count_links('/ball_sim/' + topic, '/ball_sim_replay') for topic in
                    ('ball_states', 'ball_properties')) and
                all(count_links('/ball_sim/' + topic, rospy.get_name()) for topic in
                    ('markers', 'scene_markers')))

    def test_record_and_replay(self):
        bag = self.record()
        self.replay(bag, self.check(bag))


if __name__ == '__main__':
    rospy.init_node('record_replay_test')
    rostest.rosrun('ball_sim', 'record_replay_test', RecordReplayTest)
