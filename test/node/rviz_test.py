#!/usr/bin/python3
"""RViz itself, as simulation.launch starts it, on a screen in memory: what one sees."""
import os
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

import rospy
import rostest
from PIL import ImageGrab
from std_srvs.srv import Trigger

from ball_sim.srv import DeleteBalls, Reset
from support import PATIENCE, Process, call

# What the test looks for: pixels of about these colours (0..255), as few as a ball must have. Balls
# are a dozen pixels wide, a hundred in area; shading darkens all but their middles.
YELLOW = (255, 199, 13)  # ball 1
RED = (230, 26, 31)  # ball 3
GREEN_CLOTH = (15, 148, 87)
PIXELS_OF_A_BALL = 15
PIXELS_OF_A_TABLE = 20000


def count(image, color):
    """Pixels of a colour, whatever their brightness (down to half of the full one)."""
    data = image.convert('RGB').tobytes()
    length = sum(c * c for c in color) ** 0.5
    found = 0
    for i in range(0, len(data), 3):
        pixel = data[i:i + 3]
        size = sum(p * p for p in pixel) ** 0.5
        if size < 0.5 * length:
            continue
        cosine = sum(p * c for p, c in zip(pixel, color)) / (size * length)
        found += cosine > 0.995  # within 6 degrees of hue and saturation
    return found


class Screen:
    """An X server without hardware."""

    def __init__(self):
        read, write = os.pipe()
        self._server = subprocess.Popen(
            ['Xvfb', '-displayfd', str(write), '-screen', '0', '1280x800x24', '-nolisten', 'tcp'],
            pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as pipe:
            self.name = ':' + pipe.readline().strip()

    def picture(self):
        """The 3D view: right of the panel of displays, above the panel of time."""
        return ImageGrab.grab(xdisplay=self.name).crop((380, 70, 1250, 690))

    def close(self):
        self._server.terminate()
        self._server.wait(PATIENCE)


class RvizTest(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.screen = Screen()
        os.environ['DISPLAY'] = self.screen.name
        os.environ['LIBGL_ALWAYS_SOFTWARE'] = '1'
        os.environ['XDG_RUNTIME_DIR'] = self.folder
        os.environ['QT_QPA_PLATFORM'] = 'xcb'
        self.process = Process(['roslaunch', 'ball_sim', 'simulation.launch', 'paused:=true'])

    def tearDown(self):
        keep = os.environ.get('BALL_SIM_PICTURES')
        if keep:
            self.screen.picture().save(os.path.join(keep, self.id() + '.png'))
        self.process.signal(signal.SIGINT)
        self.process.stop()
        self.screen.close()
        shutil.rmtree(self.folder)

    def wait_for_picture(self, good, what):
        deadline = time.monotonic() + 2 * PATIENCE
        while True:
            picture = self.screen.picture()
            if good(picture):
                return picture
            if time.monotonic() > deadline:
                path = os.path.join(tempfile.gettempdir(), 'ball_sim_rviz_test.png')
                picture.save(path)
                self.fail('never seen: %s; the picture is in %s\n%s' %
                          (what, path, self.process.output()))
            time.sleep(0.2)

    def sees_balls(self, picture):
        return all(count(picture, color) >= PIXELS_OF_A_BALL for color in (YELLOW, RED))

    def sees_no_balls(self, picture):
        return not any(count(picture, color) for color in (YELLOW, RED))

    def test_shows_balls_and_shows_none_when_there_are_none(self):
        picture = self.wait_for_picture(self.sees_balls, 'balls')
        self.assertGreater(count(picture, GREEN_CLOTH), PIXELS_OF_A_TABLE)
        call('/ball_sim/delete_balls', DeleteBalls, all=True)
        picture = self.wait_for_picture(self.sees_no_balls, 'a table without balls')
        self.assertGreater(count(picture, GREEN_CLOTH), PIXELS_OF_A_TABLE)
        # RViz clears everything when time runs back; all of it must return.
        call('/ball_sim/resume', Trigger)
        call('/ball_sim/reset', Reset, what='time')
        picture = self.wait_for_picture(
            lambda p: self.sees_balls(p) and count(p, GREEN_CLOTH) > PIXELS_OF_A_TABLE,
            'balls and table after time has run back')
        for word in ('ERROR', 'WARN'):
            self.assertNotIn(word, self.process.output())


if __name__ == '__main__':
    rospy.init_node('rviz_test')
    rostest.rosrun('ball_sim', 'rviz_test', RvizTest)
