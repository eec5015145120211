#!/usr/bin/python3
"""Every launch file: what it starts exists, and every argument is documented."""
import glob
import os
import unittest

import roslaunch.arg_dump
import roslaunch.config
import roslaunch.rlutil
import roslaunch.xmlloader
import roslib.packages
import rostest

FOLDER = os.path.join(roslib.packages.get_pkg_dir('ball_sim'), 'launch')
FILES = sorted(os.path.basename(f) for f in glob.glob(os.path.join(FOLDER, '*.launch')))
REQUIRED = {'replay.launch': ['bag:=some.bag']}


def load(name, *arguments):
    """The nodes that a launch file starts, by name."""
    config = roslaunch.config.ROSLaunchConfig()
    loader = roslaunch.xmlloader.XmlLoader()
    loader.load(os.path.join(FOLDER, name), config, verbose=False,
                argv=list(REQUIRED.get(name, [])) + list(arguments))
    return {node.name: node for node in config.nodes}, config


class LaunchFilesTest(unittest.TestCase):

    def test_all_are_there(self):
        self.assertEqual(FILES, ['replay.launch', 'rviz.launch', 'simulation.launch'])

    def test_what_they_start_exists(self):
        for name in FILES:
            if name not in REQUIRED:
                self.assertIsNone(
                    roslaunch.rlutil.check_roslaunch(os.path.join(FOLDER, name)), name)
            for arguments in ((), ('rviz:=false',), ('record:=true',)):
                if name == 'rviz.launch' and arguments:
                    continue
                if name == 'replay.launch' and 'record:=true' in arguments:
                    continue
                nodes, config = load(name, *arguments)
                self.assertEqual(config.config_errors, [])
                for node in nodes.values():
                    self.assertTrue(roslib.packages.find_node(node.package, node.type),
                                    node.package + '/' + node.type)

    def test_every_argument_is_documented(self):
        for name in FILES:
            arguments = roslaunch.arg_dump.get_args([os.path.join(FOLDER, name)])
            for argument, (doc, _) in arguments.items():
                self.assertTrue(doc, name + ': ' + argument)

    def test_simulation_arguments(self):
        arguments = roslaunch.arg_dump.get_args([os.path.join(FOLDER, 'simulation.launch')])
        for name in ('scene', 'method', 'time_step', 'tolerance', 'threads', 'rviz', 'paused',
                     'real_time_factor', 'seed', 'color_by', 'record', 'bag_prefix',
                     'use_sim_time'):
            self.assertIn(name, arguments)

    def test_arguments_say_what_starts(self):
        self.assertIn('rviz', load('simulation.launch')[0])
        self.assertNotIn('rviz', load('simulation.launch', 'rviz:=false')[0])
        self.assertIn('/ball_sim/wait_for_viewer', load('simulation.launch')[1].params)
        self.assertNotIn('/ball_sim/wait_for_viewer',
                         load('simulation.launch', 'rviz:=false')[1].params)
        _, config = load('simulation.launch', 'method:=continuous', 'time_step:=0.002',
                         'tolerance:=1e-4', 'threads:=2')
        for name, value in (('method', 'continuous'), ('time_step', 0.002), ('tolerance', 1e-4),
                            ('threads', 2)):
            self.assertEqual(config.params['/ball_sim/' + name].value, value)
        self.assertNotIn('ball_sim_record', load('simulation.launch')[0])
        recorder = load('simulation.launch', 'record:=true', 'bag_prefix:=here')[0]['ball_sim_record']
        for word in ('--split', '--lz4', 'here', 'ball_states', 'ball_properties', 'collisions',
                     'stats'):
            self.assertIn(word, recorder.args)
        self.assertNotIn('/ball_sim/markers', recorder.args)
        self.assertNotIn('ball_sim', load('replay.launch')[0])  # the player owns /clock


if __name__ == '__main__':
    rostest.rosrun('ball_sim', 'launch_files_test', LaunchFilesTest)
