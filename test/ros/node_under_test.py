"""Starts and ends the nodes that a test of this folder looks at, and waits for what they do."""
import os
import random
import signal
import socket
import subprocess
import time
import xml.etree.ElementTree as ElementTree

import roslib.packages
import rospy
import rosunit
import rosunit.xmlrunner

PACKAGE = "us_ct_registration"
LIMIT_S = 60.0


def wait_for(condition, what, limit_s=LIMIT_S):
    """The first true value of condition(); fails after limit_s."""
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError(f"waited {limit_s:.0f} s for {what}")


def free_port():
    """A TCP port on which nothing listens, below those that the system gives to whatever program asks for any."""
    with open("/proc/sys/net/ipv4/ip_local_port_range") as stream:
        first_given = int(stream.read().split()[0])
    while True:
        with socket.socket() as one:
            try:
                one.bind(("localhost", random.randrange(1024, first_given)))
                return one.getsockname()[1]
            except OSError:
                continue


def unitrun(name, test_case):
    """rosunit.unitrun, which reports a skipped test as passed, extended by the skipped tests and their reasons."""
    without_skips = rosunit.xmlrunner._XMLTestResult.xml

    def xml(result, *arguments):
        tree = without_skips(result, *arguments)
        reasons = {test.id(): reason for test, reason in result.skipped}
        for case in tree.getroot().iter("testcase"):
            reason = reasons.get(f"{case.get('classname')}.{case.get('name')}")
            if reason is not None:
                ElementTree.SubElement(case, "skipped", message=reason)
        return tree
    rosunit.xmlrunner._XMLTestResult.xml = xml
    rosunit.unitrun(PACKAGE, name, test_case)


def has_failed(test_case):
    """Whether the test has failed; tearDown and cleanups then print logs."""
    result = test_case._outcome.result
    return any(failed is test_case for failed, _ in result.errors + result.failures)


class Process:
    """A node or nodelet `kind` in the namespace `namespace`, with private parameters: by itself, or a nodelet in the
    manager of this name; the kind `manager` is a manager. `environment`: variables that are added; `name`: another
    name than the kind; `remaps`: topics by the names that the node has for them."""

    def __init__(self, kind, namespace, log, as_nodelet=False, manager=None, environment=None, name=None, remaps=None,
                 **parameters):
        nodelet = roslib.packages.find_node("nodelet", "nodelet")[0]
        if kind == "manager":
            command = [nodelet, "manager"]
        elif manager:
            command = [nodelet, "load", f"{PACKAGE}/{kind}", manager]
        elif as_nodelet:
            command = [nodelet, "standalone", f"{PACKAGE}/{kind}"]
        else:
            command = [roslib.packages.find_node(PACKAGE, kind)[0]]
        name = name or kind
        command += [f"__ns:={namespace}", f"__name:={name}"]
        command += [f"{own}:={other}" for own, other in (remaps or {}).items()]
        node = f"{namespace}/{name}"
        if rospy.has_param(node):
            rospy.delete_param(node)
        for key, value in parameters.items():
            rospy.set_param(f"{node}/{key}", value)
        self._log_path = log
        with open(log, "ab") as stream:
            self._process = subprocess.Popen(command, stdout=stream, stderr=subprocess.STDOUT,
                                             env=dict(os.environ, **(environment or {})))

    def kill(self):
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGKILL)
        self._process.wait(LIMIT_S)

    def exit_status(self):
        return self._process.wait(LIMIT_S)

    def own_mib(self):
        """Its memory that no file backs, MiB."""
        with open(f"/proc/{self._process.pid}/status") as stream:
            kb = next(line.split()[1] for line in stream if line.startswith("RssAnon:"))
        return int(kb) / 1024

    def log(self):
        with open(self._log_path, errors="replace") as stream:
            return stream.read()


class Newest:
    """The newest message of a topic."""

    def __init__(self, topic, kind):
        self.message = None
        self._subscriber = rospy.Subscriber(topic, kind, self._take)

    def _take(self, message):
        self.message = message

    def wait(self, condition, what):
        return wait_for(lambda: self.message if self.message and condition(self.message) else None,
                        f"{what}, the newest being:\n{self.message}")


def call(name, kind, *arguments):
    rospy.wait_for_service(name, LIMIT_S)
    return rospy.ServiceProxy(name, kind)(*arguments)
