"""What the node's tests share."""
import os
import subprocess
import threading
import time
import xmlrpc.client

import roslib.packages
import rospy

# s of wall time; only a broken node takes so long, however busy the machine is.
PATIENCE = 30


class Listener:
    """Collects what comes on a topic."""

    def __init__(self, topic, message_type):
        self._messages = []
        self._changed = threading.Condition()
        self._subscriber = rospy.Subscriber(topic, message_type, self._add)

    def _add(self, message):
        with self._changed:
            self._messages.append(message)
            self._changed.notify_all()

    def wait_for_publisher(self, count=1):
        """Waits until `count` publishers send to it; what they publish from then on, comes."""
        topic = self._subscriber.resolved_name
        wait_until(lambda: count_links(topic, rospy.get_name()) >= count, 'a publisher')

    def clear(self):
        with self._changed:
            self._messages = []

    def messages(self):
        with self._changed:
            return list(self._messages)

    def wait(self, wanted, what='message'):
        """Waits for a message for which wanted(message) is true, and returns the first."""
        def find():
            return next((m for m in self._messages if wanted(m)), None)
        with self._changed:
            if not self._changed.wait_for(lambda: find() is not None, PATIENCE):
                raise AssertionError('never came: ' + what)
            return find()

    def wait_count(self, count):
        """Waits for so many messages, and returns them."""
        with self._changed:
            if not self._changed.wait_for(lambda: len(self._messages) >= count, PATIENCE):
                raise AssertionError('%d messages of %d came' % (len(self._messages), count))
            return self._messages[:count]

    def close(self):
        self._subscriber.unregister()


def wait_until(condition, what, patience=PATIENCE):
    """Waits until condition() is true, looking often."""
    deadline = time.monotonic() + patience
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError('never came: ' + what)
        time.sleep(0.02)


def count_links(topic, subscriber):
    """How many publishers of a topic send to a node.

    They are asked themselves: a subscriber believes in a connection a little too soon.
    """
    master = rospy.get_master()
    publishers = dict(master.getSystemState()[2][0]).get(topic, [])
    count = 0
    for name in publishers:
        try:
            node = xmlrpc.client.ServerProxy(master.lookupNode(name)[2])
            links = node.getBusInfo(rospy.get_name())[2]
        except (OSError, rospy.MasterException, TypeError):  # not there, or not any more
            continue
        # Of a link: number, who is at the other end, direction (o: out), transport, topic.
        count += any(link[1] == subscriber and link[2] == 'o' and link[4] == topic
                     for link in links)
    return count


def call(name, service_type, **fields):
    """Calls a service, waiting for it to appear."""
    rospy.wait_for_service(name, PATIENCE)
    return rospy.ServiceProxy(name, service_type)(**fields)


def scene(name):
    """Path of a scene for tests."""
    return roslib.packages.get_pkg_dir('ball_sim') + '/test/node/scenes/' + name + '.yaml'


class Process:
    """A program, its output, and its end."""

    def __init__(self, command):
        # As a shell would: rostest moves its nodes to ROS_HOME and leaves PWD behind.
        environment = dict(os.environ, PWD=os.getcwd())
        self._process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True,
            env=environment)
        self._lines = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self._process.stdout:
            self._lines.append(line)

    def output(self):
        return ''.join(self._lines)

    def signal(self, number):
        self._process.send_signal(number)

    def wait(self, patience=PATIENCE):
        """Waits for its end and returns the exit code."""
        code = self._process.wait(patience)
        self._reader.join(patience)
        return code

    def stop(self):
        """Ends it if it still runs."""
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()


def start_node(name, **parameters):
    """Starts ball_sim_node under a name of its own, so that its parameters are its own too."""
    program = roslib.packages.find_node('ball_sim', 'ball_sim_node')[0]
    arguments = ['_%s:=%s' % item for item in parameters.items()]
    return Process([program, '__name:=' + name] + arguments)
